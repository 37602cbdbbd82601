"""Physical motor constants, as far as winding resistance or current separate them.

Drive and speed alone give gain, time constant and friction. The motor's equations are

    u = R i + Kf w,    J dw/dt = Kt i - B w - Tc

The winding resistance R, or a measured current, separates Kf from the losses. Logs slower than 1 kHz do not
show the inductance. Kt, J, B and Tc keep a common factor until a torque is measured; the usual convention is
Kt = Kf.
"""

from dataclasses import dataclass

import numpy as np

from thumper_tuning.identify.motor import IdentifiedMotor
from thumper_tuning.logs.motor_log import DriveUnit, MotorLog
from thumper_tuning.logs.units import FULL_PWM, NOMINAL_V

MIN_CURRENT_A = 0.05
MIN_ROWS = 10
NOTE = (
    "Kt is assumed equal to Kf (a gearbox makes it smaller); inductance is not identifiable from these logs"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class PhysicalConstants:
    """Constants on the wheel's side of the gearbox."""

    resistance_Ohm: float
    back_emf_V_s_rad: float  # Kf
    torque_Nm_A: float  # Kt, assumed equal to Kf
    inertia_kg_m2: float  # J
    viscous_Nm_s_rad: float  # B
    friction_Nm: float  # Tc
    note: str = NOTE


def physical_constants(
    motor: IdentifiedMotor, logs: list[MotorLog], resistance_Ohm: float | None
) -> PhysicalConstants | None:
    """Return Kf, J, B and friction, or None if neither current nor resistance is known.

    With a current, u = R i + Kf w is a regression; if R is given, only Kf is fitted. Without a current, R
    cannot separate viscous friction from back-EMF. Viscous friction is then assumed zero, which gives the
    largest Kf.
    """
    volts = 1.0 if motor.unit is DriveUnit.VOLT else (motor.supply_V or NOMINAL_V) / FULL_PWM
    volts_per_rad_s = volts / motor.model.gain
    R, Kf = resistance_Ohm, volts_per_rad_s
    rows = _steady_rows(logs)
    if rows is not None:
        u, i, w = rows
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


def _steady_rows(logs: list[MotorLog]) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Return drive, current and speed of rows in steady state, where an averaged current is right."""
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
    if len(rows) < MIN_ROWS or np.abs(rows[:, 1]).max() < MIN_CURRENT_A:
        return None
    return rows[:, 0], rows[:, 1], rows[:, 2]
