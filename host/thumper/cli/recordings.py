"""`thumper recover` and `thumper export`: repair recordings and convert them."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from thumper.cli.options.common import Recordings

if TYPE_CHECKING:
    from thumper.recording.reader import Recording


def recover(
    places: Annotated[
        list[Path], typer.Argument(help="Truncated recordings (.mcap, .mcap.part), or folders of them.")
    ],
) -> None:
    """Repair recordings that a crash or a full disk truncated; keep everything up to that point.

    Example: `thumper recover library/`
    """
    from thumper.common.errors import EXIT_USAGE, ThumperError
    from thumper.recording.repair import repair_all, unfinished_recordings

    paths = [
        path for place in places for path in (unfinished_recordings(place) if place.is_dir() else [place])
    ]
    if not paths:
        print("nothing to repair")
    failures = repair_all(paths, print)
    if len(failures) > 1:
        for failure in failures:
            print(failure)
        raise ThumperError(
            f"{len(failures)} of {len(paths)} files could not be repaired; they are unchanged",
            exit_code=EXIT_USAGE,
        )
    if failures:
        raise failures[0]


def export(
    files: Recordings,
    csv: Annotated[Path | None, typer.Option(help="Write one table per topic to this folder.")] = None,
    map_file: Annotated[
        Path | None, typer.Option("--map", help="Write the last map to this .yaml, with its .pgm beside it.")
    ] = None,
    png: Annotated[
        Path | None, typer.Option(help="Draw the last map and the driven path to this file.")
    ] = None,
    animation: Annotated[
        Path | None, typer.Option(help="Draw the drive as a moving picture to this .webp or .gif.")
    ] = None,
    speed: Annotated[
        float, typer.Option(min=0.1, help="Speed of the moving picture relative to real time.")
    ] = 4.0,
    force: Annotated[
        bool, typer.Option("--force", help="Overwrite the files of --map and the tables of --csv.")
    ] = False,
) -> None:
    """Convert a recording to CSV tables, a map file or a picture.

    Example: `thumper export library/ --csv tables --png drive.png --animation drive.webp`
    """
    from thumper.cli.output.folder import prepare_output
    from thumper.common.errors import EXIT_USAGE, ThumperError
    from thumper.recording.export import export_csv
    from thumper.recording.reader import Recording, find_recordings

    if not (csv or map_file or png or animation):
        raise ThumperError(
            "nothing to export: give --csv DIR, --map FILE, --png FILE or --animation FILE",
            exit_code=EXIT_USAGE,
        )
    if animation and animation.suffix not in (".webp", ".gif"):
        raise ThumperError(
            f"--animation {animation}: unknown picture format; end the name in .webp or .gif",
            exit_code=EXIT_USAGE,
        )
    if not force:
        _refuse_existing(csv, map_file)
    recording = Recording(find_recordings(files))
    if csv:
        prepare_output(csv, "--csv")
        tables = export_csv(recording, csv)
        print(f"in {csv}/: {', '.join(path.name for path in tables)}")
    if map_file or png:
        _export_map(recording, map_file, png)
    if animation:
        _export_animation(recording, animation, speed)
    for note in recording.notes:
        print(f"note: {note}")


def _refuse_existing(csv: Path | None, map_file: Path | None) -> None:
    """Raise ThumperError if a table in the folder `csv`, or a file of the map, exists."""
    from thumper.common.errors import EXIT_USAGE, ThumperError
    from thumper.maps.map_server_io import map_yaml_path

    there = [("--csv", path) for path in sorted(csv.glob("*.csv"))] if csv else []
    if map_file:
        yaml_path = map_yaml_path(map_file)
        there += [("--map", path) for path in (yaml_path, yaml_path.with_suffix(".pgm")) if path.exists()]
    if there:
        option, path = there[0]
        raise ThumperError(
            f"{path} already exists; choose another {option} or add --force", exit_code=EXIT_USAGE
        )


def _export_map(recording: "Recording", map_file: Path | None, png: Path | None) -> None:
    from thumper.cli.output.folder import prepare_output
    from thumper.common.errors import EXIT_USAGE, ThumperError
    from thumper.maps.map_server_io import map_yaml_path, save_map
    from thumper.maps.plot import plot_map
    from thumper.recording.export import last_map

    grid, path_m = last_map(recording)
    if map_file:
        prepare_output(map_file.parent, "--map")
        description = map_yaml_path(map_file)
        image = save_map(grid, description)
        print(f"{description} and {image.name}")
    if png:
        prepare_output(png.parent, "--png")
        try:
            plot_map(grid, path_m, png, recording.paths[0].name)
        except (OSError, ValueError) as error:
            raise ThumperError(f"{png}: cannot be written ({error})", exit_code=EXIT_USAGE) from error
        print(str(png))


def _export_animation(recording: "Recording", path: Path, speed: float) -> None:
    from thumper.cli.output.folder import prepare_output
    from thumper.recording.animation import animate

    prepare_output(path.parent, "--animation")
    frames = animate(recording, path, speed)
    print(f"{path}: {frames} frames, {path.stat().st_size / 1e6:.1f} MB")
