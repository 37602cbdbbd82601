"""Heading with a gyroscope on recorded drives of a four-wheel skid-steered robot.

Run: THUMPER_DATA=FOLDER python benchmarks/gyroscope.py

FOLDER/imu holds EncodersNN.mat and imuNN.mat, a robot of 0.254 m wheels at 0.39 m. The reference is the
gyroscope alone with a constant bias: its mean over all standstills, of which the filter knows only those that
have passed. It is good to 0.1-0.3 rad, because the bias changes by up to 0.005 rad/s in a drive.
"""

import os
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.figure import figure

from thumper.common.geometry import FloatArray
from thumper.common.kinematics import DriveGeometry
from thumper.imu.options import ImuOptions
from thumper.imu.sample import ImuSample
from thumper.odometry.gyro_ekf import GyroEkf
from thumper.odometry.wheel_odometry import WheelOdometry

DATA = Path(os.environ.get("THUMPER_DATA", Path(__file__).resolve().parents[2] / "shared" / "data")) / "imu"
GEOMETRIC = DriveGeometry(wheel_radius_m=0.127, track_m=0.39, counts_per_rev=720)  # counts of both wheels
IMU = ImuOptions(enabled=True, noise_rad_s=1.2e-4, bias_rad_s=0.02, bias_walk_rad_s=1e-4)
STANDING_S = 1.0
EFFECTIVE_TRACKS_M = np.arange(0.80, 1.06, 0.01)


@dataclass(frozen=True, slots=True, kw_only=True)
class Log:
    """A recorded drive: rows of the encoders and of the gyroscope."""

    times_s: FloatArray  # shape (n,), of the encoders
    counts: FloatArray  # shape (n, 2), left and right since the start
    gyro_s: FloatArray  # shape (m,)
    rates_rad_s: FloatArray  # shape (m,), counter-clockwise, with the bias
    heading_rad: FloatArray  # shape (n,), by the gyroscope alone


def numbers() -> list[str]:
    """Return the numbers of the recorded drives, such as 20."""
    found = (path.stem.removeprefix("Encoders") for path in DATA.glob("Encoders*.mat"))
    return sorted(number for number in found if (DATA / f"imu{number}.mat").exists())


def load(number: str) -> Log:
    """Read a recorded drive."""
    from scipy.io import loadmat

    encoders = loadmat(DATA / f"Encoders{number}.mat")["Encoders"][0, 0]
    imu = loadmat(DATA / f"imu{number}.mat")
    name = next(key for key in imu if not key.startswith("__") and key != "ts")
    box = imu if "ts" in imu else imu[name][0, 0]
    start_s = float(box["ts"].min())
    times_s = encoders["ts"].ravel().astype(np.float64) - start_s
    front_right, front_left, rear_right, rear_left = np.cumsum(encoders["counts"].astype(np.float64), axis=1)
    counts = np.column_stack([front_left + rear_left, front_right + rear_right])
    gyro_s, rates = box["ts"].ravel().astype(np.float64) - start_s, box["vals"][5].astype(np.float64)
    moved = times_s[1:][np.any(np.diff(counts, axis=0) != 0.0, axis=1)]
    before = np.searchsorted(moved, gyro_s)
    far = np.concatenate([[-np.inf], moved, [np.inf]])
    stands = (gyro_s - far[before] > STANDING_S) & (far[before + 1] - gyro_s > STANDING_S)
    steps_s = np.diff(gyro_s, prepend=gyro_s[0])
    turned = np.cumsum((rates - rates[stands].mean()) * steps_s)
    return Log(
        times_s=times_s,
        counts=counts,
        gyro_s=gyro_s,
        rates_rad_s=rates,
        heading_rad=np.interp(times_s, gyro_s, turned),
    )


def rms_rad(log: Log, odometry: WheelOdometry | GyroEkf) -> float:
    """Return the rms difference of the heading from the reference [rad]."""
    headings, fed = [], 0
    for time_s, counts in zip(log.times_s, log.counts, strict=True):
        while isinstance(odometry, GyroEkf) and fed < log.gyro_s.size and log.gyro_s[fed] <= time_s:
            sample = ImuSample(time_s=float(log.gyro_s[fed]), yaw_rate_rad_s=float(log.rates_rad_s[fed]))
            odometry.add_imu(sample)
            fed += 1
        pose = odometry.update(float(time_s), int(counts[0]), int(counts[1])).odom_from_base
        headings.append(pose.theta_rad)
    error_rad = np.unwrap(np.array(headings)) - log.heading_rad
    return float(np.sqrt(np.mean(np.square(error_rad - error_rad[0]))))


def effective(log: Log) -> DriveGeometry:
    """Return the geometry with the track that suits the wheels alone best."""
    tracks = [replace(GEOMETRIC, track_m=float(track)) for track in EFFECTIVE_TRACKS_M]
    return min(tracks, key=lambda geometry: rms_rad(log, WheelOdometry(geometry)))


def main() -> None:
    """Print the heading's rms difference from the reference, by wheels alone and fused."""
    for number in numbers():
        log = load(number)
        best = effective(log)
        for name, geometry in (("geometric", GEOMETRIC), (f"effective {best.track_m:.2f} m", best)):
            fused = GyroEkf(geometry, imu=IMU)
            wheels_rad, fused_rad = rms_rad(log, WheelOdometry(geometry)), rms_rad(log, fused)
            figure(
                f"drive {number}, {name} track, heading error rms: wheels alone / fused",
                f"{wheels_rad:.2f} / {fused_rad:.3f}",
                "rad",
            )
        found = fused.track.ratio
        if found is not None:
            figure(f"drive {number}: effective track found", f"{best.track_m / found.ratio:.2f}", "m")


if __name__ == "__main__":
    main()
