"""Keep the session of a run on disk, so that a crash does not lose it."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from thumper.maps.map_server_io import save_map
from thumper.runtime.loop import RobotLoop
from thumper.runtime.requests import LogMessage
from thumper.runtime.service.autosave import Autosave
from thumper.slam.saved_state import SavedSlamState, save_session

AUTOSAVE, INTERRUPTED = "autosave.session", "interrupted.session"


@contextmanager
def autosaved(robot: RobotLoop, out: Path) -> Iterator[None]:
    """Save the session every few seconds; a run that ends regularly removes the file."""

    def report(text: str) -> None:
        robot.request_queue.put(LogMessage(text=text))

    autosave = Autosave(robot.inputs.estimator, out / AUTOSAVE, report)
    robot.after_cycle.append(autosave.step)
    is_regular = False
    try:
        yield
        is_regular = True
    finally:
        robot.after_cycle.remove(autosave.step)
        autosave.close(remove=is_regular)


def keep_interrupted_session(out: Path) -> None:
    """Rename the session of a run that did not end regularly, and print how to resume it."""
    path, kept = out / AUTOSAVE, out / INTERRUPTED
    if path.exists():
        path.replace(kept)
        print(f"the last run did not end: --session {kept} resumes its map", flush=True)


def save_map_and_session(robot: RobotLoop, out: Path) -> list[str]:
    """Write the map of a robot that has served to `out`; return the file names, none without a map."""
    state = robot.inputs.estimator.state()
    if state is None or not robot.inputs.has_map:
        return []
    image = save_map(robot.mapper.grid(), out / "map.yaml")
    session = SavedSlamState.from_mapper(robot.mapper, state.map_from_base)
    return [image.name, "map.yaml", save_session(session, out / "map.session").name]
