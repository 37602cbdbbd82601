"""Keep the session of a run on disk, and resume it after a crash."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from thumper.cli.start_map import load_start_map
from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2
from thumper.config.robot import RobotConfig
from thumper.maps.annotations import annotations_path, save_annotations
from thumper.maps.library import set_aside
from thumper.maps.map_server_io import save_map
from thumper.maps.occupancy_grid import OCCUPIED
from thumper.runtime.loop import RobotLoop
from thumper.runtime.requests import LogMessage
from thumper.runtime.service.autosave import Autosave
from thumper.slam.saved_state import SavedSlamState, save_session

AUTOSAVE, INTERRUPTED = "autosave.session", "interrupted.session"
STOOD_M = 0.05  # what the odometry of a standing robot may show


@contextmanager
def autosaved(robot: RobotLoop, out: Path) -> Iterator[None]:
    """Save the session every few seconds; a run that ends normally, with its map saved, removes the file.

    So does a new run that fails before the robot has moved, for example because the goal is refused: there is
    nothing to resume.
    """

    def report(text: str) -> None:
        robot.request_queue.put(LogMessage(text=text))

    was_there = (out / AUTOSAVE).exists()
    autosave = Autosave(robot.inputs.estimator, lambda: robot.annotations, out / AUTOSAVE, report)
    robot.after_cycle.append(autosave.step)
    is_regular = False
    try:
        yield
        is_regular = True
    except KeyboardInterrupt as interrupt:  # while it writes the map, for example
        if str(interrupt) or not (out / AUTOSAVE).exists():
            raise
        text = f"the motors are off; the map was not saved, but the next run with --out {out} resumes it"
        raise KeyboardInterrupt(text) from None
    finally:
        robot.after_cycle.remove(autosave.step)
        has_only_stood = robot.inputs.estimator.driven_m < STOOD_M and not was_there and not robot.annotations
        autosave.close(remove=(is_regular and robot.inputs.has_map) or has_only_stood)


def load_interrupted(settings: RobotConfig, out: Path, start: Pose2 | None) -> SavedSlamState | None:
    """Return the session of the last run into `out`, if that run did not end normally.

    It holds the pose of the robot; a start pose that was given for the earlier run is wrong by now, and a
    line says that it is not used. A session without a wall is removed: the robot cannot find its place in it.

    Raises
    ------
    ThumperError
        The session cannot be used.
    """
    path = out / AUTOSAVE
    if not path.exists():
        return None
    age_s = time.time() - path.stat().st_mtime
    print(
        f"the last run did not end normally: resuming its map of {age_s:.0f} s ago; --fresh starts a new one",
        flush=True,
    )
    try:
        session = load_start_map(settings, None, path)
    except ThumperError as error:
        raise ThumperError(f"{error}, or --fresh to start a new map", exit_code=error.exit_code) from error
    assert isinstance(session, SavedSlamState)
    if not np.any(session.counts.grid(settings.mapping.occupied_fraction).cells == OCCUPIED):
        print("it has no walls: starting a new map", flush=True)
        path.unlink()
        return None
    if start is not None:
        print("--start is not used: the robot starts where that run last saw it", flush=True)
    return session


def set_aside_interrupted(out: Path) -> None:
    """Rename the session of a run that did not end normally, and print how to resume it later."""
    path, kept = out / AUTOSAVE, out / INTERRUPTED
    if path.exists():
        path.replace(kept)
        if annotations_path(path).exists():
            annotations_path(path).replace(annotations_path(kept))
        print(f"the last run did not end normally: --session {kept} resumes its map", flush=True)


def keep_earlier_map(out: Path, opened: Path | None) -> Callable[[], None]:
    """Return what to call before a run writes its map to `out`; it renames the map of an earlier run there.

    The run has `opened` a map or session: it may replace the one that it continues. Later calls do nothing.
    """
    continued = {(out / name).resolve() for name in ("map.yaml", "map.session", AUTOSAVE)}
    may_replace = opened is not None and opened.resolve() in continued

    def keep() -> None:
        nonlocal may_replace
        if may_replace:
            return
        if name := set_aside(out / "map.yaml"):
            print(f"the map of an earlier run is kept as {out / name}.yaml", flush=True)
        may_replace = True  # it is this run's own from now on

    return keep


def save_map_and_session(robot: RobotLoop, out: Path) -> list[str]:
    """Write the map of a robot that has served to `out`; return the file names, none without a map."""
    state = robot.inputs.estimator.state()
    if state is None or not robot.inputs.has_map:
        return []
    robot.before_save()
    image = save_map(robot.mapper.grid(), out / "map.yaml", robot.inputs.estimator.map_datum())
    session = save_session(SavedSlamState.from_mapper(robot.mapper, state.map_from_base), out / "map.session")
    zones = save_annotations(robot.annotations, annotations_path(out / "map.yaml"))
    return [image.name, "map.yaml", session.name, *zones]
