"""`thumper replay`: run a recording through the mapper again, or publish it on a bus."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from thumper.cli.options.common import MapFolder, Recordings

if TYPE_CHECKING:
    from thumper.common.geometry import FloatArray


def replay(
    files: Recordings,
    out: MapFolder = Path("out/replay"),
    speed: Annotated[float, typer.Option(help="Real-time factor; 0: as fast as possible.", min=0.0)] = 0.0,
    config: Annotated[
        Path | None,
        typer.Option(help="TOML file of a robot whose options replace the recorded ones, to compare them."),
    ] = None,
    bus: Annotated[
        str, typer.Option(help="HOST:PORT of a bus on which to publish every recorded message.")
    ] = "",
) -> None:
    """Map a recording again from its wheel and lidar data: the same input gives the same map.

    Example: `thumper replay library/ --speed 1 --bus 127.0.0.1:7448`
    """
    from thumper.cli.output.folder import prepare_output
    from thumper.common.geometry import Pose2
    from thumper.config.robot import load_config
    from thumper.maps.map_server_io import save_map
    from thumper.recording.reader import Recording, find_recordings
    from thumper.recording.replay import ReplayResult
    from thumper.recording.replay import replay as run
    from thumper.slam.saved_state import SavedSlamState, save_session

    recording = Recording(find_recordings(files))
    settings = load_config(config) if config else None
    prepare_output(out)
    if bus:
        from thumper.recording.bus_recorder import replay_on_bus

        result: ReplayResult = replay_on_bus(recording, settings, bus, speed or 1.0)
    else:
        result = run(recording, settings, speed=speed)
    from thumper.maps.plot import plot_map  # slow: matplotlib

    grid, path = result.mapper.grid(), result.path
    save_map(grid, out / "map.yaml")
    x_m, y_m, theta_rad = (float(value) for value in path[-1, 1:])
    end = Pose2(x_m=x_m, y_m=y_m, theta_rad=theta_rad)
    save_session(SavedSlamState.from_mapper(result.mapper, end), out / "map.session")
    plot_map(grid, path[:, 1:3], out / "map.png", recording.paths[0].name)
    _write_trajectory(path, out / "trajectory.csv")
    print(f"{result.time_s:.1f} s replayed, {result.scans} scans mapped")
    if result.maps_recorded:
        print(f"{result.maps_identical} of {result.maps_recorded} maps match the recorded ones cell for cell")
    if result.unreadable:
        print(f"note: {result.unreadable} messages could not be read")
    for note in recording.notes:
        print(f"note: {note}")
    print(f"in {out}/: map.pgm, map.yaml, map.session, map.png, trajectory.csv")


def _write_trajectory(path: "FloatArray", file: Path) -> None:
    """Write rows of time [s], x [m], y [m] and heading [rad] as CSV."""
    from thumper.common.files import write_csv

    write_csv(
        file, ("time_s", "x_m", "y_m", "theta_rad"), ([f"{value:.6f}" for value in row] for row in path)
    )
