"""`thumper recover` and `thumper export`: what is done with recordings afterwards."""

from pathlib import Path
from typing import Annotated

import typer


def recover(
    places: Annotated[
        list[Path], typer.Argument(help="Torn recordings (.mcap, .mcap.part), or folders of them.")
    ],
) -> None:
    """Make recordings whole that a crash or a full disk has torn; everything up to the tear is kept."""
    from thumper.common.errors import EXIT_USAGE, ThumperError
    from thumper.recording.repair import left_behind, recover_all

    paths = [path for place in places for path in (left_behind(place) if place.is_dir() else [place])]
    if not paths:
        print("nothing to repair")
    if not recover_all(paths, print):
        raise ThumperError(
            "not every file could be repaired; those that could not are as they were", exit_code=EXIT_USAGE
        )


def export(
    files: Annotated[
        list[Path], typer.Argument(help="Recordings (.mcap) of one run in their order, or their folder.")
    ],
    csv: Annotated[Path | None, typer.Option(help="Folder for a table of each topic.")] = None,
    map_file: Annotated[
        Path | None, typer.Option("--map", help="The last map: a .yaml, with the .pgm beside it.")
    ] = None,
    png: Annotated[Path | None, typer.Option(help="A picture of the last map and the path driven.")] = None,
) -> None:
    """Turn a recording into tables (CSV), a map file, a picture."""
    from thumper.cli.output_folder import prepare_output
    from thumper.common.errors import EXIT_USAGE, ThumperError
    from thumper.maps.map_server_io import map_yaml_path, save_map
    from thumper.maps.plot import plot_map
    from thumper.recording.export import export_csv, last_map
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
    for note in recording.notes:
        print(f"note: {note}")
