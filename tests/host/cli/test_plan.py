"""`thumper plan` on the command line: answers, files and one-line errors."""

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from tests.host.navigation.planners.test_astar import room_with_wall
from thumper.cli.app import build_app
from thumper.common.errors import ThumperError
from thumper.maps.map_server_io import encode_pgm, save_map
from thumper.maps.occupancy_grid import OccupancyGrid


@pytest.fixture
def room(tmp_path: Path) -> Path:
    grid = OccupancyGrid(cells=room_with_wall(), resolution_m=0.05, origin_x_m=-1.0, origin_y_m=0.0)
    save_map(grid, tmp_path / "room.yaml")
    return tmp_path / "room.yaml"


def call(*words: object) -> tuple[int, str]:
    result = CliRunner().invoke(build_app(), ["plan", *map(str, words)])
    if isinstance(result.exception, ThumperError):
        assert "\n" not in str(result.exception)
        return result.exception.exit_code, str(result.exception)
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result.exit_code, result.output


@pytest.mark.parametrize("planner", ["navfn", "astar", "lattice"])
def test_path_as_text_json_and_picture(room: Path, planner: str, tmp_path: Path) -> None:
    ends = ("--start", 0, 1, "--goal", 3, 1)
    code, words = call(room, *ends, "--planner", planner)
    assert (code, " m in " in words) == (0, True)
    code, text = call(room, *ends, "--planner", planner, "--json", "--png", tmp_path / "p.png")
    answer = json.loads(text)
    assert (code, answer["found"], answer["planner"]) == (0, True, planner)
    assert answer["path"][-1] == pytest.approx([3, 1], abs=0.06)
    steps = np.diff(np.array(answer["path"]), axis=0)
    assert answer["length_m"] == pytest.approx(np.hypot(*steps.T).sum(), abs=0.01)
    assert (tmp_path / "p.png").read_bytes()[:4] == b"\x89PNG"


def test_a_picture_is_named_and_ends_in_png(room: Path, tmp_path: Path) -> None:
    ends = ("--start", 0, 1, "--goal", 3, 1)
    code, text = call(room, *ends, "--png", tmp_path / "p.png")
    assert code == 0
    assert f"map and path are in {tmp_path / 'p.png'}" in text.replace("\n", "")
    code, text = call(room, *ends, "--png", tmp_path / "p.xyz")
    assert (code, text) == (2, f"--png {tmp_path / 'p.xyz'}: the name of a picture ends in .png")
    assert not (tmp_path / "p.xyz").exists()


def test_exits_with_1_without_a_path(room: Path) -> None:
    assert call(room, "--start", 0, 1, "--goal", 3, 1, "--planner", "carrot")[0] == 1
    code, text = call(room, "--start", 0, 1, "--goal", 1.52, 1)
    assert (code, text.split(":")[0]) == (1, "no path")
    code, text = call(room, "--start", 0, 1, "--goal", 1.52, 1, "--json")
    assert (code, json.loads(text)["found"], json.loads(text)["path"]) == (1, False, [])


@pytest.mark.parametrize(
    ("rows", "lengths"),
    [
        ("start_x,start_y,goal_x,goal_y\n0,1,0,2\n0,1,1,1\n", [1.0, 1.0]),
        ("0,1,0,2\n", [1.0]),
        ("start_x_m,start_y_m,goal_x_m,goal_y_m,note\n0,1,0,2,a\n", [1.0]),
        ("start_col,start_row_from_bottom,goal_col,goal_row_from_bottom\n20,20,20,40\n", [1.0]),
    ],
)
def test_batch(room: Path, tmp_path: Path, rows: str, lengths: list[float]) -> None:
    (tmp_path / "q.csv").write_text(rows)
    code, text = call(room, "--batch", tmp_path / "q.csv", "--json")
    assert code == 0
    assert [answer["length_m"] for answer in json.loads(text)] == pytest.approx(lengths, abs=0.02)
    code, text = call(room, "--batch", tmp_path / "q.csv")
    assert len(text.splitlines()) == 1 + len(lengths)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ((), "pass also --start X Y and --goal X Y, or --batch FILE.csv"),
        (("--goal", 3, 1), "pass also --start X Y, or --batch FILE.csv"),
        (("--start", "nan", 1, "--goal", 3, 1), "finite"),
        (("--start", 0, 1, "--goal", 1e300, 0.5), "the goal (1e+300, 0.5) is farther than 1000 m"),
        (("--start", 0, 1, "--goal", 3, 1, "--planner", "x"), "unknown planner 'x'; choose from: astar"),
        (("--batch", "gone.csv"), "cannot be read"),
        (("--batch", "gone.csv", "--start", 0, 1), "leave"),
    ],
)
def test_invalid_options(room: Path, words: tuple[object, ...], message: str) -> None:
    code, text = call(room, *words)
    assert message in text
    assert code in (1, 2)


def test_a_missing_map_is_named_before_a_missing_option(tmp_path: Path) -> None:
    code, text = call(tmp_path / "gone.yaml", "--goal", 1, 1)
    assert (code, "gone.yaml: cannot be read" in text) == (2, True)


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ("", "has no rows"),
        ("start_x,start_y,goal_x,goal_y\n", "has a header but no rows"),
        ("a,b,c,d\n1,2,3,4\n", "needs the columns start_x"),
        ("start_x,start_y,goal_x,goal_y\n1,2,3,x\n", "line 2: 'x' is not a number; fix column 4"),
        ("1,2,3\n", "line 1: '' is not a number; fix column 4"),
    ],
)
def test_invalid_batch_files(room: Path, tmp_path: Path, rows: str, message: str) -> None:
    (tmp_path / "q.csv").write_text(rows)
    code, text = call(room, "--batch", tmp_path / "q.csv")
    assert code == 2
    assert message in text


def mask(folder: Path, name: str, pixels: np.typing.NDArray[np.uint8], mode: str) -> Path:
    """Write a mask of the room; row 0 of the pixels is at the top."""
    (folder / f"{name}.pgm").write_bytes(encode_pgm(pixels))
    (folder / f"{name}.yaml").write_text(
        f"image: {name}.pgm\nmode: {mode}\nresolution: 0.05\norigin: [-1.0, 0.0, 0]\nnegate: 0\n"
        "occupied_thresh: 0.99\nfree_thresh: 0.25\n"
    )
    return folder / f"{name}.yaml"


def test_masks_lengthen_the_path_and_slow_the_drive(room: Path, tmp_path: Path) -> None:
    shape = room_with_wall().shape
    pixels = np.full(shape, 254, np.uint8)
    ends = ("--start", 0, 1, "--goal", 0, 2, "--json")
    plain = json.loads(call(room, *ends)[1])
    assert plain["travel_s"] == pytest.approx(plain["length_m"] / 0.4, rel=1e-3)
    assert (plain["start_category"], plain["goal_category"]) == ("free", "free")

    pixels[:] = 103  # darkness 0.596: (0.596 - 0.25) / 0.74 takes 47 % off
    slow = json.loads(call(room, *ends, "--speed-mask", mask(tmp_path, "slow", pixels, "scale"))[1])
    assert slow["length_m"] == plain["length_m"]
    assert slow["travel_s"] == pytest.approx(plain["travel_s"] / 0.53, rel=1e-3)

    pixels[:] = 254
    pixels[shape[0] - 30, 15:25] = 0  # row 29 from the bottom: y = 1.45 to 1.5, x = -0.25 to 0.25
    shut = mask(tmp_path, "shut", pixels, "trinary")
    round_ = json.loads(call(room, *ends, "--keepout", shut)[1])
    assert round_["length_m"] > plain["length_m"] + 0.1
    code, text = call(room, "--start", 0, 1, "--goal", 0, 1.47, "--keepout", shut, "--json")
    assert (code, json.loads(text)["goal_category"]) == (1, "lethal")
    code, text = call(room, *ends, "--keepout", tmp_path / "none.yaml")
    assert (code, "none.yaml" in text) == (2, True)


def test_it_says_how_much_of_the_path_leads_through_unknown_space(tmp_path: Path) -> None:
    cells = np.zeros((60, 100), np.int8)
    cells[:, 40:60] = -1  # 1 m
    grid = OccupancyGrid(cells=cells, resolution_m=0.05, origin_x_m=0.0, origin_y_m=0.0)
    save_map(grid, tmp_path / "gap.yaml")
    ends = (tmp_path / "gap.yaml", "--start", 1, 1.5, "--goal", 4, 1.5)
    assert "; 1.0 m of it through unknown space" in call(*ends)[1]
    assert json.loads(call(*ends, "--json")[1])["unknown_m"] == pytest.approx(1.0, abs=0.05)
    assert "unknown" not in call(tmp_path / "gap.yaml", "--start", 0.5, 0.5, "--goal", 0.5, 2.5)[1]
