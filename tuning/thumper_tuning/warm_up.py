"""Compile the kernels of the identification: the first motor would wait for them."""

import numpy as np

from thumper_tuning.drive.excitation import ExcitationOptions, excitation_blocks
from thumper_tuning.identify.motor import identify
from thumper_tuning.identify.motor_response import DriveSignal, MotorParameters, simulate
from thumper_tuning.logs.motor_log import DriveUnit, MotorLog

RATE_HZ = 10.0
COUNT_RAD = 0.005
MOTOR = MotorParameters(
    gain=0.06,
    tau_s=0.08,
    friction_forward=20.0,
    friction_backward=20.0,
    breakaway_ratio=1.0,
    delay_s=0.0,
)


def warm_up() -> None:
    """Identify a simulated motor, with the richer models."""
    blocks = excitation_blocks(ExcitationOptions(switching_blocks=2), RATE_HZ)
    levels = [block.levels * (-1) ** number for number, block in enumerate(blocks)]
    drive = np.concatenate(levels, dtype=float)
    time_s = np.arange(len(drive)) / RATE_HZ
    angle_rad, _ = simulate(DriveSignal(time_s, drive, 0.0), time_s, 0.0, MOTOR)
    counted = MotorLog(
        name="left",
        drive_unit=DriveUnit.PWM,
        time_s=time_s,
        drive=drive,
        starts_segment=time_s == 0.0,
        position_rad=np.round(angle_rad / COUNT_RAD) * COUNT_RAD,
        quantum_rad=COUNT_RAD,
    )
    identify([counted]).second_order()
