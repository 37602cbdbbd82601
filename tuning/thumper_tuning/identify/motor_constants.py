"""The motor's physical constants, as far as resistance or current let them be told apart.

Drive and speed alone give gain, time constant and friction. With u = R i + Kf w and J dw/dt = Kt i - B
w - Tc:
the winding's R, or a measured current, separates Kf from the losses. The inductance does not show below 1 kHz
of logging, and Kt, J, B and Tc keep one common factor until a torque is known: Kt = Kf is the usual
convention.
"""

from dataclasses import dataclass

import numpy as np

from thumper_tuning.design.fixed_point import NOMINAL_V
from thumper_tuning.identify.motor import Identified
from thumper_tuning.logs.motor_log import DriveUnit, MotorLog

FULL_PWM = 255.0
LEAST_CURRENT_A = 0.05
NOTE = "Kt is taken to be Kf (a gearbox makes it smaller); inductance is not identifiable from these logs"


@dataclass(frozen=True, slots=True, kw_only=True)
class PhysicalConstants:
    """At the wheel's side of the gearbox."""

    resistance_Ohm: float
    back_emf_V_s_rad: float  # Kf
    torque_Nm_A: float  # Kt, taken equal to Kf
    inertia_kg_m2: float  # J
    viscous_Nm_s_rad: float  # B
    friction_Nm: float  # Tc
    note: str = NOTE


def physical_constants(
    motor: Identified, logs: list[MotorLog], resistance_Ohm: float | None
) -> PhysicalConstants | None:
    """Kf, J, B and friction; None without current, as R alone splits nothing off but the loss-free bound.

    With the current, u = R i + Kf w is a regression; R given, only Kf is fitted. Without a current but with R
    the viscous loss cannot be told from the back-EMF: it is taken for zero, which gives the largest Kf.
    """
    volts = 1.0 if motor.unit is DriveUnit.VOLT else (motor.supply_V or NOMINAL_V) / FULL_PWM
    volts_per_rad_s = volts / motor.model.gain
    R, Kf = resistance_Ohm, volts_per_rad_s
    current = _current(logs)
    if current is not None:
        u, i, w = current
        if R is None:
            R, Kf = (float(x) for x in np.linalg.lstsq(np.column_stack((i, w)), volts * u, rcond=None)[0])
        else:
            Kf = float(w @ (volts * u - R * i) / (w @ w))
        if R <= 0.0 or not 0.0 < Kf <= 1.2 * volts_per_rad_s:
            return None
    if R is None:
        return None
    Kf = min(Kf, volts_per_rad_s)
    Kt = Kf
    return PhysicalConstants(
        resistance_Ohm=R,
        back_emf_V_s_rad=Kf,
        torque_Nm_A=Kt,
        inertia_kg_m2=motor.model.time_constant_s * volts_per_rad_s * Kt / R,
        viscous_Nm_s_rad=(volts_per_rad_s - Kf) * Kt / R,
        friction_Nm=motor.model.friction * volts * Kt / R,
    )


def _current(logs: list[MotorLog]) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Drive, current and speed of rows in the steady state, where a current averaged over a while is
    right."""
    parts = []
    for log in logs:
        if log.current_A is None:
            return None
        speed = log.speed_rad_s
        if speed is None:
            assert log.position_rad is not None
            speed = np.concatenate(([np.nan], np.diff(log.position_rad) / np.diff(log.time_s)))
        steady = np.zeros(len(speed), dtype=bool)
        steady[4:] = [
            np.ptp(log.drive[k - 4 : k + 1]) <= 0.06 * abs(log.drive[k]) for k in range(4, len(speed))
        ]
        use = steady & np.isfinite(speed) & np.isfinite(log.current_A) & (np.abs(log.drive) > 0)
        parts.append(np.column_stack((log.drive, log.current_A, speed))[use])
    rows = np.concatenate(parts)
    if len(rows) < 10 or np.abs(rows[:, 1]).max() < LEAST_CURRENT_A:
        return None
    return rows[:, 0], rows[:, 1], rows[:, 2]
