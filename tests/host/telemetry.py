"""A board's telemetry for tests: all zero but what a test says."""

from dataclasses import fields
from typing import Any

from thumper.board.board import TelemetrySample
from thumper.board.messages import Fault, State, Telemetry


def telemetry_sample(time_s: float, **said: Any) -> TelemetrySample:
    """As it would come at `time_s` from a board that holds its wheels; `said` are fields of `Telemetry`."""
    nothing = dict.fromkeys((field.name for field in fields(Telemetry)), 0)
    as_it_is = {"time_us": round(1e6 * time_s), "state": State.CLOSED_LOOP, "fault": Fault.NONE}
    return TelemetrySample(time_s=time_s, telemetry=Telemetry(**(nothing | as_it_is | said)))
