"""Switches between mapping and localization: the commands `localize`, `map_on` and `relocalize`."""

from thumper.common.errors import ThumperError
from thumper.gps.earth_reference import PLACE_UNKNOWN, MapDatum
from thumper.gps.fix import FixStatus
from thumper.ros.services import MappingState
from thumper.runtime.sensor_inputs import SensorInputs
from thumper.slam.mapper import Mapper
from thumper.slam.mode_switch import SlamModeSwitch

MODES = ("localize", "map_on", "relocalize")


def change(mapper: Mapper, mode: str) -> str:
    """Switch to one of `MODES` and return a description of it.

    Raises
    ------
    ThumperError
        Nothing is mapped yet, the pose is lost, or this mapper cannot switch.
    """
    if not isinstance(mapper, SlamModeSwitch):
        raise ThumperError("this robot's mapper cannot switch between mapping and localization")
    match mode:
        case "localize":
            was_localizing = mapper.is_localizing
            mapper.localize()
            return f"the map stays fixed; {_found(mapper) if was_localizing else 'the robot localizes in it'}"
        case "map_on":
            mapper.resume_mapping()
            return "the robot resumes mapping"
        case "relocalize":
            mapper.relocalize()
            return "the robot searches the whole map for its pose"
    raise ThumperError(f"unknown mode {mode!r}; choose from: {', '.join(MODES)}")


def _found(mapper: SlamModeSwitch) -> str:
    lost = mapper.quality().lost
    return f"the robot still searches for its pose: {lost}" if lost else "the robot has found its pose in it"


def describe(inputs: SensorInputs) -> MappingState:
    """Return the mode, why pose and map must not be trusted (empty if they can), and the place on Earth."""
    estimator = inputs.estimator
    mapper, state, datum = estimator.mapper, estimator.state(), estimator.map_datum()
    return MappingState(
        mode=mapper.mode if isinstance(mapper, SlamModeSwitch) else "mapping",
        lost=state.lost if state else "",
        map_doubt=estimator.map_doubt,
        datum=datum.text if datum else "",
        gps=_gps_state(inputs, datum),
    )


def _gps_state(inputs: SensorInputs, datum: MapDatum | None) -> str:
    fix = inputs.estimator.fix
    if not inputs.has_gps:
        return "off"
    if fix is None or fix.status is FixStatus.NONE:
        return "the GPS has no fix"
    return "ok" if datum else PLACE_UNKNOWN
