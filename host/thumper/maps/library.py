"""The robot's library: one folder with its saved maps and its recordings."""

import re
from itertools import count
from pathlib import Path
from typing import Any

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.files import read_text, write_text
from thumper.maps.annotations import NAME, NAME_HELP, annotations_path

MAX_LISTED = 200
MAX_DESCRIPTION_MB = 1.0
RECORDING = ".mcap"
MAP_SUFFIXES = (".yaml", ".pgm", ".session", ".geojson")


def map_path(folder: Path, name: str) -> Path:
    """Return the .yaml of a map; raises ThumperError for a name that is none."""
    return folder / f"{checked_name(name)}.yaml"


def checked_name(name: str) -> str:
    """Return the name of a map or recording, which is no path; raises ThumperError for any other."""
    if not NAME.fullmatch(name):
        raise ThumperError(f"name: use {NAME_HELP}", exit_code=EXIT_USAGE)
    return name


def map_files(yaml_path: Path) -> list[Path]:
    """Return the files of a map that exist: description, image, session, zones and places."""
    paths = [yaml_path, yaml_path.with_suffix(".pgm"), yaml_path.with_suffix(".session")]
    return [path for path in (*paths, annotations_path(yaml_path)) if path.is_file()]


def item_files(folder: Path, name: str) -> list[Path]:
    """Return the files of a map, or of a recording, whose name ends in .mcap; raises ThumperError if none."""
    if checked_name(name).endswith(RECORDING):
        files = [path for path in [folder / name] if path.is_file()]
    else:
        files = map_files(map_path(folder, name))
    if not files:
        raise ThumperError(f"{name} is not in {folder}")
    return files


def delete_item(folder: Path, name: str) -> None:
    """Delete a map with all its files, or a recording; raises ThumperError if that fails."""
    try:
        for path in item_files(folder, name):  # the description first: without it the rest is no map
            path.unlink(missing_ok=True)
    except OSError as error:
        raise ThumperError(f"{name}: cannot be deleted ({error.strerror})") from error


def rename_item(folder: Path, name: str, new_name: str) -> None:
    """Rename a map with all its files, or a recording; raises ThumperError if that fails."""
    files = item_files(folder, name)
    if name.endswith(RECORDING) != checked_name(new_name).endswith(RECORDING):
        raise ThumperError(f"the name of a recording, and of nothing else, ends in {RECORDING}")
    stem, new_stem = name.removesuffix(RECORDING), new_name.removesuffix(RECORDING)
    moves = {path: path.with_name(new_stem + path.name[len(stem) :]) for path in files}
    taken = [new.name for new in moves.values() if new.exists()]
    if taken:
        raise ThumperError(f"there is a file {taken[0]} already: choose another name")
    try:
        for path, new in moves.items():
            if path.suffix == MAP_SUFFIXES[0]:
                _write_description(path, new)
            else:
                path.rename(new)
        for path in moves:  # the old description last: until then the map has its old name, too
            path.unlink(missing_ok=True)
    except (OSError, UnicodeDecodeError) as error:
        raise ThumperError(f"{name}: cannot be renamed ({error})") from error


def set_aside(yaml_path: Path) -> str:
    """Rename the map at `yaml_path`, if there is one, to the first free `map_1`, `map_2`; return that name.

    Raises
    ------
    ThumperError
        A file cannot be renamed.
    """
    folder, name = yaml_path.parent, yaml_path.stem
    if not map_files(yaml_path):
        return ""
    new_names = (f"{name}_{number}" for number in count(1))
    new_name = next(new for new in new_names if not map_files(folder / f"{new}.yaml"))
    rename_item(folder, name, new_name)
    return new_name


def _write_description(path: Path, new: Path) -> None:
    """Write a map's description under a new name: it names the image."""
    image = rf"^(image:\s*[\"']?){re.escape(path.stem)}\.pgm"
    text = read_text(path, MAX_DESCRIPTION_MB)
    write_text(new, re.sub(image, lambda found: f"{found[1]}{new.stem}.pgm", text, flags=re.MULTILINE))


def list_maps(folder: Path) -> list[dict[str, Any]]:
    """Return name, size [MB] and Unix time [s] of each map, newest first."""
    found = [(path, map_files(path)) for path in folder.glob("*.yaml") if path.with_suffix(".pgm").is_file()]
    return _listed([(path.stem, files) for path, files in found])


def list_recordings(folder: Path) -> list[dict[str, Any]]:
    """Return name, size [MB] and Unix time [s] of each finished recording, newest first."""
    return _listed([(path.name, [path]) for path in folder.glob(f"*{RECORDING}")])


def _listed(items: list[tuple[str, list[Path]]]) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = []
    for name, files in items:
        try:
            stats = [path.stat() for path in files]
        except OSError:  # removed meanwhile
            continue
        size_MB = 1e-6 * sum(stat.st_size for stat in stats)
        saved_s = max(stat.st_mtime for stat in stats)
        rows.append({"name": name, "MB": round(size_MB, 2), "saved_s": round(saved_s)})
    return sorted(rows, key=lambda row: -row["saved_s"])[:MAX_LISTED]
