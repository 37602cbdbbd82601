"""Compare models of one motor by validation fit: the fit's own, richer grey boxes, ERA of order 1 and 2."""

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from thumper.common.geometry import FloatArray
from thumper_tuning.identify.cross_validation import validate
from thumper_tuning.identify.fit import Fit
from thumper_tuning.identify.realization import (
    impulse_response,
    linear_record,
    predict_linear,
    realize,
    slow_time_constant_s,
)
from thumper_tuning.identify.richer_models import RicherModel
from thumper_tuning.identify.segments import LogSegment, all_speeds
from thumper_tuning.identify.systems import counted_second_order_system, counted_system
from thumper_tuning.logs.motor_log import BoolArray

if TYPE_CHECKING:
    import control

ERA_ORDERS = (1, 2)


@dataclass(frozen=True, slots=True, kw_only=True)
class ComparedModel:
    """A model as a discrete python-control system, and how well it predicts held-out speeds."""

    kind: str
    fit_percent: float | None  # None: the model of the whole log, or of a part of it, is unstable
    time_constant_s: float | None
    second_time_constant_s: float | None = None
    system: "control.LTI | None"  # from drive without friction to counted speed; None: not linear


def compare_models(
    segments: list[LogSegment], fit: Fit, fit_percent: float, richer: list[RicherModel], period_s: float
) -> list[ComparedModel]:
    """Return the models, the fit's own first. ERA needs regular rows.

    ERA gets the measured direction of motion with the drive, because friction depends on it. The other
    models predict the direction from the drive alone.
    """
    found = [
        ComparedModel(
            kind="first order (the fit)",
            fit_percent=fit_percent,
            time_constant_s=fit.model.time_constant_s,
            system=counted_system(fit.model, period_s),
        )
    ]
    for model in richer:
        lag_s = model.second_time_constant_s
        found.append(
            ComparedModel(
                kind=model.kind,
                fit_percent=model.fit_percent,
                time_constant_s=model.base.time_constant_s,
                second_time_constant_s=lag_s or None,
                system=counted_second_order_system(model.base, lag_s, period_s) if lag_s > 0.0 else None,
            )
        )
    return [*found, *era_models(segments, fit)]


def era_models(segments: list[LogSegment], fit: Fit) -> list[ComparedModel]:
    """Return the ERA models of order 1 and 2, without the fit's friction; none for irregular rows."""
    record = linear_record(segments, fit.model)
    if record is None:
        return []
    use, speeds, found = ~fit.is_glitch, all_speeds(segments), []

    responses: dict[bytes, FloatArray] = {}  # of the windows that are not held out: both orders need them
    is_stable: dict[int, bool] = dict.fromkeys(ERA_ORDERS, True)

    def system_of(response: FloatArray, order: int) -> "control.LTI":
        system = realize(response, order, record.period_s)
        is_stable[order] &= bool(np.all(np.abs(system.poles()) < 1.0))
        return system

    def residuals(order: int, kept: BoolArray) -> FloatArray:
        key = kept.tobytes()
        if key not in responses:
            responses[key] = impulse_response(record, use & kept)
        return speeds - predict_linear(record, system_of(responses[key], order))

    markov = impulse_response(record, use)
    for order in ERA_ORDERS:
        system = system_of(markov, order)
        held_out = validate(segments, fit, partial(residuals, order))
        found.append(
            ComparedModel(
                kind=f"ERA, order {order}",
                fit_percent=held_out.fit_percent if is_stable[order] else None,
                time_constant_s=slow_time_constant_s(system),
                system=system,
            )
        )
    return found
