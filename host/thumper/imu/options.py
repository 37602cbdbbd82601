"""Options of the gyroscope: the `[imu]` table of the robot's TOML."""

import math
from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Ge, Gt


@dataclass(frozen=True, slots=True, kw_only=True)
class GyroNoise:
    """Noise of a gyroscope's yaw rate."""

    rate_rad_s: float  # std of the mean rate over 1 s
    bias_rad_s: float  # std of the bias at power-on
    bias_walk_rad_s: float  # std of the change of the bias in 1 s

    def mean_rate_std_rad_s(self, period_s: float) -> float:
        """Return the standard deviation of the mean rate over `period_s`, without that of the bias."""
        return self.rate_rad_s / math.sqrt(period_s)


# BNO08x data sheet, game rotation vector: heading drift 0.5 deg/min, after its own calibration of the bias.
# The rate is that of yaw angles in steps of 0.01 deg.
BNO08X = GyroNoise(rate_rad_s=5e-4, bias_rad_s=1.5e-4, bias_walk_rad_s=2e-5)
# MPU-6050 product specification: 0.005 deg/s/sqrt(Hz), and heading steps of 1/65536 revolution. The board
# measures the bias at each stop; between stops it drifts with the temperature (20 deg/s over 125 K).
MPU6050 = GyroNoise(rate_rad_s=1.5e-4, bias_rad_s=5e-4, bias_walk_rad_s=1e-4)
ImuModel = Literal["bno08x", "mpu6050"]
NOISE: dict[ImuModel, GyroNoise] = {"bno08x": BNO08X, "mpu6050": MPU6050}


@dataclass(frozen=True, slots=True, kw_only=True)
class ImuOptions:
    """Options of the gyroscope; a noise of 0 means that of the model's data sheet."""

    enabled: bool = False  # fuse the gyroscope's rate with the wheels' odometry
    model: ImuModel = "bno08x"  # bno08x: UART-RVC, on a port of its own; mpu6050: on the board
    port: str = "/dev/ttyUSB1"  # serial device or sim://NAME/imu
    noise_rad_s: Annotated[float, Ge(0)] = 0.0  # std of the mean rate over 1 s
    bias_rad_s: Annotated[float, Ge(0)] = 0.0  # std of the bias at power-on
    bias_walk_rad_s: Annotated[float, Ge(0)] = 0.0  # std of the change of the bias in 1 s
    slip_sigmas: Annotated[float, Gt(0.75)] = 3.0  # a larger disagreement is not fused, and counts as this

    @property
    def uses_board(self) -> bool:
        """Whether the gyroscope is the one of the motor board."""
        return self.enabled and self.model == "mpu6050"

    @property
    def noise(self) -> GyroNoise:
        """The noise: that of the options, else of the data sheet."""
        device = NOISE[self.model]
        return GyroNoise(
            rate_rad_s=self.noise_rad_s or device.rate_rad_s,
            bias_rad_s=self.bias_rad_s or device.bias_rad_s,
            bias_walk_rad_s=self.bias_walk_rad_s or device.bias_walk_rad_s,
        )
