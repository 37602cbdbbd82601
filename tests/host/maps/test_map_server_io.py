"""Saved maps load unchanged; the error for a broken one names the problem."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from thumper.common.errors import ThumperError
from thumper.maps.map_server_io import load_datum, load_map, read_occupancy, save_map
from thumper.maps.occupancy_grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid


def grid_of(cells: np.ndarray[tuple[int, int], np.dtype[np.int8]]) -> OccupancyGrid:
    return OccupancyGrid(cells=cells, resolution_m=0.05, origin_x_m=-1.25, origin_y_m=7.4)


def saved(folder: Path) -> Path:
    cells = np.array([[UNKNOWN, FREE, OCCUPIED], [FREE, FREE, UNKNOWN]], dtype=np.int8)
    path = folder / "map.yaml"
    save_map(grid_of(cells), path)
    return path


@given(
    cells=arrays(
        np.int8, st.tuples(st.integers(1, 9), st.integers(1, 9)), elements=st.sampled_from([-1, 0, 100])
    )
)
def test_round_trip(tmp_path_factory: pytest.TempPathFactory, cells: np.ndarray) -> None:
    path = tmp_path_factory.mktemp("map") / "map.yaml"
    grid = grid_of(cells)
    save_map(grid, path)
    loaded = load_map(path)
    np.testing.assert_array_equal(loaded.cells, grid.cells)
    assert (loaded.resolution_m, loaded.origin_x_m, loaded.origin_y_m) == (0.05, -1.25, 7.4)


def test_the_files_are_what_map_server_reads(tmp_path: Path) -> None:
    path = saved(tmp_path)
    lines = path.read_text().splitlines()
    assert lines == [
        "image: map.pgm",
        "resolution: 0.05",
        "origin: [-1.25, 7.4, 0.0]",
        "negate: 0",
        "occupied_thresh: 0.65",
        "free_thresh: 0.196",
    ]
    # The image's first row is the map's last.
    assert (tmp_path / "map.pgm").read_bytes() == b"P5\n3 2\n255\n" + bytes([254, 254, 205, 205, 254, 0])
    assert sorted(p.name for p in tmp_path.iterdir()) == ["map.pgm", "map.yaml"]


def test_percentages_become_three_classes(tmp_path: Path) -> None:
    save_map(grid_of(np.array([[0, 19, 20, 64, 65, 100, -1]], dtype=np.int8)), tmp_path / "m.yaml")
    assert load_map(tmp_path / "m.yaml").cells.tolist() == [[0, 0, -1, -1, 100, 100, -1]]


def test_a_negated_text_image_loads(tmp_path: Path) -> None:
    (tmp_path / "m.pgm").write_bytes(b"P2\n# handmade\n2 2\n15\n15 0\n7 15\n")
    (tmp_path / "m.yaml").write_text(
        "# a comment\nimage: 'm.pgm'\nmode: trinary\nresolution: 0.1 # metres\norigin: [1, 2, 0]\n"
        "negate: 1\noccupied_thresh: 0.65\nfree_thresh: 0.25\n"
    )
    assert load_map(tmp_path / "m.yaml").cells.tolist() == [[UNKNOWN, OCCUPIED], [OCCUPIED, FREE]]


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("resolution: 0.05", "resolution: five", ["resolution", "five"]),
        ("resolution: 0.05", "resolution: -1", ["resolution", "-1"]),
        ("resolution: 0.05", "resolution: nan", ["resolution", "nan"]),
        ("resolution: 0.05\n", "", ["resolution", "missing"]),
        ("image: map.pgm\n", "", ["image", "missing"]),
        ("image: map.pgm", "image: gone.pgm", ["gone.pgm"]),
        ("[-1.25, 7.4, 0.0]", "[-1.25, 7.4]", ["origin", "[-1.25, 7.4]"]),
        ("[-1.25, 7.4, 0.0]", "[-1.25, 7.4, 0.5]", ["origin", "0.5"]),
        ("free_thresh: 0.196", "free_thresh: 0.9", ["occupied_thresh", "0.65"]),
        ("negate: 0", "negate: perhaps", ["negate", "perhaps"]),
        ("negate: 0", "mode: raw\nnegate: 0", ["mode", "raw"]),
    ],
)
def test_an_invalid_yaml_file_names_file_key_and_value(
    tmp_path: Path, old: str, new: str, words: list[str]
) -> None:
    path = saved(tmp_path)
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    with pytest.raises(ThumperError) as error:
        load_map(path)
    for word in [str(tmp_path), *words]:
        assert word in str(error.value)


def test_a_text_without_keys_is_no_map_file(tmp_path: Path) -> None:
    path = tmp_path / "README.md"
    path.write_text("# Robot\n\nNote: read this.\n")
    with pytest.raises(ThumperError, match=r"README\.md: not a map file; pass the \.yaml file"):
        load_map(path)


@pytest.mark.parametrize(
    ("data", "word"),
    [
        (b"P5\n3 2\n255\n\0\0", "cut off"),
        (b"\x89PNG\r\n", "not a PGM"),
        (b"P5\n3 x\n255\n" + bytes(6), "not a valid 8-bit PGM image .*x"),
        (b"P5\n3 2\n65535\n" + bytes(12), "not a valid 8-bit PGM image"),
        (b"P6\n1 1\n255\n" + bytes(3), "not a valid 8-bit PGM image"),
        (b"P2\n1 1\n255\nwhite\n", "not a valid 8-bit PGM image .*white"),
        (b"P2\n1 1\n255\n300\n", "not a valid 8-bit PGM image .*300"),
        (b"P5", "header"),
        (b"", "not a PGM"),
    ],
)
def test_an_invalid_image_is_named(tmp_path: Path, data: bytes, word: str) -> None:
    path = saved(tmp_path)
    (tmp_path / "map.pgm").write_bytes(data)
    with pytest.raises(ThumperError, match=word) as error:
        load_map(path)
    assert "map.pgm" in str(error.value)
    assert "\n" not in str(error.value)


def test_a_missing_map_is_one_clear_line(tmp_path: Path) -> None:
    with pytest.raises(ThumperError, match=r"nowhere\.yaml"):
        load_map(tmp_path / "nowhere.yaml")
    with pytest.raises(ThumperError, match="cannot be written"):
        save_map(grid_of(np.zeros((1, 1), dtype=np.int8)), tmp_path / "no" / "folder.yaml")


@given(image=arrays(np.uint8, st.tuples(st.integers(1, 7), st.integers(1, 7))))
def test_every_byte_of_an_image_is_read(tmp_path_factory: pytest.TempPathFactory, image: np.ndarray) -> None:
    """Including bytes that look like white space or a comment, right after the header."""
    path = saved(tmp_path_factory.mktemp("map"))
    path.write_text("mode: raw\n" + path.read_text())
    rows, cols = image.shape
    path.with_suffix(".pgm").write_bytes(f"P5\n{cols} {rows}\n255\n".encode() + image.tobytes())
    _, occupancy = read_occupancy(path, ("raw",))
    np.testing.assert_allclose(255.0 - 255.0 * occupancy[::-1], image, atol=1e-9)


def test_the_image_instead_of_the_yaml_file_is_refused(tmp_path: Path) -> None:
    image = saved(tmp_path).with_suffix(".pgm")
    with pytest.raises(ThumperError, match=r"map\.pgm: this is the map's image; pass .* \.yaml"):
        load_map(image)


@pytest.mark.parametrize("datum", ["48.0, 11.0", "98.0, 11.0, 0.0", "nan, 11.0, 0.0", "48.0, east, 0.0"])
def test_an_invalid_datum_is_refused(datum: str, tmp_path: Path) -> None:
    (tmp_path / "m.yaml").write_text(f"image: m.pgm\ndatum: [{datum}]\n")
    with pytest.raises(ThumperError, match=r"datum = .* is not .latitude_deg, .*; correct"):
        load_datum(tmp_path / "m.yaml")
