"""`thumper replay`: a recorded run through the mapper again, or back onto the bus."""

from pathlib import Path
from typing import Annotated

import typer


def replay(
    files: Annotated[
        list[Path], typer.Argument(help="Recordings (.mcap) of one run in their order, or their folder.")
    ],
    out: Annotated[
        Path, typer.Option(help="Folder for map.pgm, map.yaml, map.session, map.png and trajectory.csv.")
    ] = Path("out/replay"),
    speed: Annotated[
        float, typer.Option(help="How many times faster than it was; 0: as fast as it goes.", min=0.0)
    ] = 0.0,
    config: Annotated[
        Path | None, typer.Option(help="Another robot's TOML, to see what other options make of the run.")
    ] = None,
    bus: Annotated[
        str, typer.Option(help="HOST:PORT: say every message on a bus there again, for page and programs.")
    ] = "",
) -> None:
    """Give recorded wheels and scans to the robot's mapper again: the same inputs, the same map."""
    import csv

    from thumper.cli.output_folder import prepare_output
    from thumper.common.geometry import Pose2
    from thumper.config.robot import load_config
    from thumper.maps.map_server_io import save_map
    from thumper.maps.plot import plot_map
    from thumper.recording.reader import Recording, find_recordings
    from thumper.recording.replay import Replayed
    from thumper.recording.replay import replay as run
    from thumper.slam.saved_state import SavedSlamState, save_session

    recording = Recording(find_recordings(files))
    settings = load_config(config) if config else None
    prepare_output(out)
    if bus:
        from thumper.recording.bus_recorder import replay_on_bus

        result: Replayed = replay_on_bus(recording, settings, bus, speed or 1.0)
    else:
        result = run(recording, settings, speed=speed)
    grid, path = result.mapper.grid(), result.path
    save_map(grid, out / "map.yaml")
    x_m, y_m, theta_rad = (float(value) for value in path[-1, 1:])
    end = Pose2(x_m=x_m, y_m=y_m, theta_rad=theta_rad)
    save_session(SavedSlamState.from_mapper(result.mapper, end), out / "map.session")
    plot_map(grid, path[:, 1:3], out / "map.png", recording.paths[0].name)
    with (out / "trajectory.csv").open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(("time_s", "x_m", "y_m", "theta_rad"))
        writer.writerows((f"{t:.6f}", f"{x:.6f}", f"{y:.6f}", f"{theta:.6f}") for t, x, y, theta in path)
    print(f"{result.time_s:.1f} s replayed, {result.scans} scans mapped")
    if result.maps_recorded:
        print(f"{result.maps_same} of {result.maps_recorded} maps are the recorded ones cell by cell")
    if result.unreadable:
        print(f"note: {result.unreadable} messages could not be read")
    for note in recording.notes:
        print(f"note: {note}")
    print(f"in {out}/: map.pgm, map.yaml, map.session, map.png, trajectory.csv")
