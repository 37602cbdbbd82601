"""Error of the fused position: simulated drives with a simulated receiver, wheels and a gyroscope.

Run: python benchmarks/shared/gps_drive.py

Each drive takes 240 s at 0.5 m/s through curves. The odometry has a scale error of 2 % and the drift of a
BNO08x; the receiver sends its bytes to the real driver, which reads them every 0.1 s.
"""

import math
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.gps.driver import GpsDriver
from thumper.gps.fix import FixStatus
from thumper.gps.local_plane import LatLon, LocalPlane
from thumper.gps.navsat_filter import NavsatFilter
from thumper.gps.options import GpsOptions
from thumper.odometry.pose_buffer import PoseBuffer, interpolate_poses
from thumper.odometry.wheel_odometry import OdometrySample, advance
from thumper_hil.faults.switches import Switches
from thumper_hil.sensors.gnss_receiver import BAUD, DATUM, GnssReceiver

STEP_S, DRIVE_S, REST_S, SETTLED_S = 0.1, 240.0, 15.0, 60.0
SPEED_M_S = 0.5
SCALE_ERROR = 0.02
BIAS_RAD_S, NOISE_RAD_S = 1.5e-4, 5e-4  # of the gyroscope
HEADING_VAR_PER_S = BIAS_RAD_S**2 * 60.0 + NOISE_RAD_S**2
ANTENNA = Pose2(x_m=-0.05)
LATENCY_S = GpsOptions().latency_s


class Port:
    """The host's end of the receiver's line, read once per control cycle."""

    url, baud = "simulated", BAUD

    def __init__(self, device: GnssReceiver) -> None:
        """Connect a device."""
        self.device, self.time_s = device, 0.0

    def now_s(self) -> float:
        """Return the time [s]."""
        return self.time_s

    def read_available(self, timeout_s: float | None = None) -> bytes:
        """Return what has arrived; time passes only if the caller waits."""
        self.time_s += timeout_s or 0.0
        self.device.advance(self.time_s)
        return self.device.read()

    def close(self) -> None:
        """Do nothing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Drive:
    """Errors of the fused pose at each step, and of the odometry alone, from the start of the drive."""

    times_s: FloatArray
    errors_m: FloatArray  # NaN before the filter starts
    headings_rad: FloatArray
    stds_m: FloatArray
    raw_errors_m: FloatArray  # of the positions, once the robot drives
    rejected: int
    fixes: int

    def raw_rms_m(self) -> float:
        """Return the error of the positions themselves [m rms]."""
        return float(np.sqrt(np.mean(self.raw_errors_m**2)))

    def rms_m(self, from_s: float = SETTLED_S, until_s: float = math.inf) -> float:
        """Return the error [m rms] within a time."""
        inside = (self.times_s >= from_s) & (self.times_s < until_s)
        return float(np.sqrt(np.nanmean(self.errors_m[inside] ** 2)))

    def largest_m(self, from_s: float, until_s: float) -> float:
        """Return the largest error [m] within a time."""
        inside = (self.times_s >= from_s) & (self.times_s < until_s)
        return float(np.max(self.errors_m[inside]))


def drive(
    kind: str,
    rate_Hz: int,
    seed: int,
    *,
    blocked_s: tuple[float, float] = (0.0, 0.0),
    shifted_s: tuple[float, float] = (0.0, 0.0),
    shift_m: float = 5.0,
) -> Drive:
    """Simulate one drive; the sky is blocked, and all positions shifted, within the given times."""
    rng, faults = np.random.default_rng([seed, 77]), Switches(chip=None)  # type: ignore[arg-type]
    truth = Pose2(theta_rad=float(rng.uniform(-math.pi, math.pi)))
    odom, path = Pose2(), [(-1.0, truth.x_m, truth.y_m, truth.theta_rad)]

    def antenna_at(times_s: FloatArray) -> FloatArray:
        known = np.array(path[-40:])
        poses = interpolate_poses(times_s, known[:, 0], known[:, 1:])
        poses[:, 0] += ANTENNA.x_m * np.cos(poses[:, 2])
        poses[:, 1] += ANTENNA.x_m * np.sin(poses[:, 2])
        return poses

    device = GnssReceiver(
        pose_at=antenna_at, wall_m=lambda _x, _y: 30.0, faults=faults, kind=kind, rate_Hz=rate_Hz, seed=seed
    )
    port = Port(device)
    driver = GpsDriver(port, latency_s=LATENCY_S)  # type: ignore[arg-type]
    scale = 1.0 + SCALE_ERROR * float(rng.standard_normal())
    bias_rad_s = BIAS_RAD_S * float(rng.standard_normal())
    navsat, buffer = NavsatFilter(ANTENNA, DATUM), PoseBuffer()
    rows, raw_m, heading_var = [], [], 0.0
    start_s = port.time_s = math.ceil(port.time_s / STEP_S) * STEP_S
    for step in range(round((REST_S + DRIVE_S) / STEP_S)):
        time_s, run_s = start_s + step * STEP_S, step * STEP_S - REST_S
        faults.sky_is_blocked = blocked_s[0] <= run_s < blocked_s[1]
        faults.gps_offset_m = shift_m if shifted_s[0] <= run_s < shifted_s[1] else 0.0
        moves = run_s > 0.0
        arc_m = SPEED_M_S * STEP_S * moves
        turn_rad = 0.25 * math.sin(0.15 * run_s) * STEP_S * moves
        truth = advance(truth, arc_m, turn_rad)
        drift_rad = bias_rad_s * STEP_S + NOISE_RAD_S * math.sqrt(STEP_S) * float(rng.standard_normal())
        odom = advance(odom, scale * arc_m, turn_rad + moves * drift_rad)
        heading_var += HEADING_VAR_PER_S * STEP_S * moves
        path.append((time_s, truth.x_m, truth.y_m, truth.theta_rad))
        port.time_s = time_s
        covariance = np.diag([0.0, 0.0, heading_var])
        buffer.add(OdometrySample(time_s=time_s, odom_from_base=odom, twist=Twist2(), covariance=covariance))
        for fix in driver.poll():
            place = LatLon(fix.latitude_deg, fix.longitude_deg)
            if run_s > SETTLED_S and fix.status is not FixStatus.NONE:
                at_fix = antenna_at(np.array([fix.time_s]))[0, :2]
                raw_m.append(math.dist(LocalPlane(DATUM).to_plane(place), at_fix))
            if buffer.covers(fix.time_s):
                navsat.correct(fix, buffer.at(fix.time_s))
        navsat.predict(odom, heading_var)
        at = navsat.enu_from_base
        error_m = math.nan if at is None else at.distance_m(truth)
        heading_rad = math.nan if at is None else math.remainder(at.theta_rad - truth.theta_rad, math.tau)
        rows.append((run_s, error_m, heading_rad, navsat.std_m))
    columns = np.array(rows).T
    return Drive(
        times_s=columns[0],
        errors_m=columns[1],
        headings_rad=columns[2],
        stds_m=columns[3],
        raw_errors_m=np.array(raw_m),
        rejected=navsat.rejected,
        fixes=navsat.fixes,
    )


def rms_m(values: list[float]) -> float:
    """Return the root of the mean square."""
    return math.sqrt(float(np.mean(np.square(values))))


def main() -> None:
    """Print the figures."""
    seeds = range(1, 21)
    print("fix, rate: positions and fused [m rms], worst drive [m rms], heading [rad rms], filter's std [m]")
    for kind, rate_Hz in (("autonomous", 1), ("sbas", 1), ("sbas", 5), ("rtk", 1), ("rtk", 5), ("rtk", 10)):
        drives = [drive(kind, rate_Hz, seed) for seed in seeds]
        settled = drives[0].times_s >= SETTLED_S
        errors_m, raw_m = [each.rms_m() for each in drives], [each.raw_rms_m() for each in drives]
        heading_rad = rms_m([float(np.sqrt(np.nanmean(each.headings_rad[settled] ** 2))) for each in drives])
        std_m = float(np.mean([each.stds_m[settled].mean() for each in drives]))
        print(
            f"{kind}, {rate_Hz} Hz: {rms_m(raw_m):.3f}, {rms_m(errors_m):.3f}, {max(errors_m):.3f}, "
            f"{heading_rad:.3f}, {std_m:.3f}",
            flush=True,
        )
    for kind, rate_Hz in (("sbas", 1), ("rtk", 5)):
        plain = [drive(kind, rate_Hz, seed) for seed in seeds]
        for name, blocked_s, shifted_s in (
            ("20 s without a fix", (120.0, 140.0), (0.0, 0.0)),
            ("positions shifted by 5 m for 15 s", (0.0, 0.0), (120.0, 135.0)),
        ):
            found = [drive(kind, rate_Hz, seed, blocked_s=blocked_s, shifted_s=shifted_s) for seed in seeds]
            inside = (found[0].times_s >= 120.0) & (found[0].times_s < 140.0)
            added_m = [
                float(np.max(np.abs(one.errors_m - other.errors_m)[inside]))
                for one, other in zip(found, plain, strict=True)
            ]
            largest_m = [each.largest_m(120.0, 140.0) for each in found]
            print(
                f"{kind}, {rate_Hz} Hz, {name}: error at most {max(largest_m):.3f} m, of it added "
                f"{max(added_m):.3f} m, {rms_m(added_m):.3f} m rms of {len(found)} drives",
                flush=True,
            )


if __name__ == "__main__":
    main()
