"""What a robot does with its map, and the commands `localise`, `map_on`, `relocalise` that change it."""

from thumper.common.errors import ThumperError
from thumper.runtime.state_estimator import StateEstimator
from thumper.slam.mapper import Mapper
from thumper.slam.mode_switch import SlamModeSwitch

MODES = ("localise", "map_on", "relocalise")


def change(mapper: Mapper, mode: str) -> str:
    """Carry out one of `MODES`; returns what was done.

    Raises
    ------
    ThumperError
        Nothing is mapped yet, the pose is lost, or this robot's mapper cannot change.
    """
    if not isinstance(mapper, SlamModeSwitch):
        raise ThumperError("this robot's mapper cannot change between mapping and localising")
    match mode:
        case "localise":
            mapper.localize()
            return "the map stays as it is; the robot localises in it"
        case "map_on":
            mapper.resume_mapping()
            return "the robot goes on mapping"
        case "relocalise":
            mapper.relocalize()
            return "the robot looks for itself in the whole map"
    raise ThumperError(f"no mode {mode!r}; there are {', '.join(MODES)}")


def state(estimator: StateEstimator) -> dict[str, str]:
    """What it does now, and why the pose or the map may not be trusted; empty while they may."""
    mapper, state = estimator.mapper, estimator.state()
    return {
        "mode": mapper.mode if isinstance(mapper, SlamModeSwitch) else "mapping",
        "lost": state.lost if state else "",
        "map_doubt": estimator.map_doubt,
    }
