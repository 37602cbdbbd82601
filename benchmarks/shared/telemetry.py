"""Telemetry of a board that holds its wheels."""

from dataclasses import fields
from typing import Any

from thumper.board.board import TelemetrySample
from thumper.board.messages import Fault, State, Telemetry


def telemetry_sample(time_s: float, **values: Any) -> TelemetrySample:
    """Return telemetry of a board that holds its wheels; `values` are fields of `Telemetry`, 0 if missing."""
    zeros = dict.fromkeys((field.name for field in fields(Telemetry)), 0)
    usual = {"time_us": round(1e6 * time_s), "state": State.CLOSED_LOOP, "fault": Fault.NONE}
    return TelemetrySample(time_s=time_s, telemetry=Telemetry(**(zeros | usual | values)))
