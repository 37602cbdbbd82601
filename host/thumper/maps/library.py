"""The robot's library: one folder with its saved maps and its recordings."""

from pathlib import Path
from typing import Any

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.maps.annotations import NAME, NAME_HELP, annotations_path

MAX_LISTED = 200
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
