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
    """Repair recordings that a crash or a full disk truncated; keep everything up to that point."""
    from thumper.common.errors import EXIT_USAGE, ThumperError
    from thumper.recording.repair import repair_all, unfinished_recordings

    paths = [
        path for place in places for path in (unfinished_recordings(place) if place.is_dir() else [place])
    ]
    if not paths:
        print("nothing to repair")
    if not repair_all(paths, print):
        raise ThumperError("not every file could be repaired; the others are unchanged", exit_code=EXIT_USAGE)


def export(
    files: Recordings,
    csv: Annotated[Path | None, typer.Option(help="Write one table per topic to this folder.")] = None,
    map_file: Annotated[
        Path | None, typer.Option("--map", help="Write the last map to this .yaml, with its .pgm beside it.")
    ] = None,
    png: Annotated[
        Path | None, typer.Option(help="Draw the last map and the driven path to this file.")
    ] = None,
) -> None:
    """Convert a recording to CSV tables, a map file or a picture.

    Example: `thumper export recordings/ --csv tables --png drive.png`
    """
    from thumper.cli.output.folder import prepare_output
    from thumper.common.errors import EXIT_USAGE, ThumperError
    from thumper.recording.export import export_csv
    from thumper.recording.reader import Recording, find_recordings

    if not (csv or map_file or png):
        raise ThumperError(
            "nothing to export: give --csv DIR, --map FILE or --png FILE", exit_code=EXIT_USAGE
        )
    recording = Recording(find_recordings(files))
    if csv:
        prepare_output(csv, "--csv")
        tables = export_csv(recording, csv)
        print(f"in {csv}/: {', '.join(path.name for path in tables)}")
    if map_file or png:
        _export_map(recording, map_file, png)
    for note in recording.notes:
        print(f"note: {note}")


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
