"""One job of a campaign: a mission through the whole robot, reduced to a row. Runs on any machine."""

import itertools
import math
from dataclasses import dataclass
from urllib.parse import urlencode

import numpy as np
from rich.console import Console

from thumper.assembly import open_robot
from thumper.cli.mission import drive_with_progress
from thumper.config.robot import RobotConfig, config_from_json, with_ports
from thumper.errors import ThumperError
from thumper.geometry import FloatArray, Pose2, wrap_angle
from thumper.kinematics import DriveGeometry, WheelSpeeds, body_twist
from thumper.mission_log import SPEED_COLUMNS, MissionLog, speed_errors
from thumper.navigation.goal import Goal
from thumper.odometry.odometry import advance
from thumper_hil.bench import simulation
from thumper_hil.campaign.spec import Job


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """What a job came to; a line of rows.csv. NaN where the drive never got that far."""

    key: str
    mission: str
    parameters: str
    seed: int
    reached: bool
    contacts: int  # ground truth
    goal_error_m: float  # ground truth
    time_s: float
    path_length_m: float
    pose_rmse_m: float  # own estimate against ground truth, all along
    pose_max_m: float
    odometry_error_m: float  # dead reckoning against ground truth, at the end
    odometry_error_rad: float
    speed_error_mean_rad_s: float  # set-point minus measured while moving, worse side
    speed_error_std_rad_s: float
    reason: str


def run_job(job: Job) -> Row:
    """Drive, and tell how it went; a drive that cannot begin is a row as well."""
    config, mission = config_from_json(job.robot_json), job.mission
    try:
        return _drive(job, config)
    except ThumperError as error:
        nothing = dict.fromkeys(
            (
                "goal_error_m",
                "time_s",
                "path_length_m",
                "pose_rmse_m",
                "pose_max_m",
                "odometry_error_m",
                "odometry_error_rad",
                "speed_error_mean_rad_s",
                "speed_error_std_rad_s",
            ),
            math.nan,
        )
        return Row(
            key=job.key,
            mission=mission.name,
            parameters=job.parameters,
            seed=job.seed,
            reached=False,
            contacts=0,
            reason=str(error),
            **nothing,
        )


def _drive(job: Job, config: RobotConfig) -> Row:
    mission = job.mission
    x_m, y_m, yaw_deg = mission.start
    options = {"world": mission.world, "x_m": x_m, "y_m": y_m, "yaw_deg": yaw_deg, "seed": job.seed}
    options |= {"lidar": config.lidar.model, "scenario": job.scenario}
    url = f"sim://{job.key.replace('/', '_')}"
    config = with_ports(config, board=f"{url}/board?{urlencode(options)}", lidar=f"{url}/lidar")
    start = Pose2(x_m=x_m, y_m=y_m, theta_rad=math.radians(yaw_deg))
    goals = [Goal(x_m=x_m, y_m=y_m) for x_m, y_m in (*mission.via, mission.goal)]
    with open_robot(config, start) as robot:
        bench = simulation(job.key.replace("/", "_"))
        results = []
        for goal in goals:
            results.append(drive_with_progress(robot, goal, mission.name, Console(quiet=True)))
            if not results[-1].reached:
                break
        truth, contacts = bench.truth(), bench.contacts
    pose_errors_m = _pose_errors_m(robot.log, truth)
    sides = speed_errors(robot.log.speeds).values()
    odometry = _dead_reckoned(robot.log.speeds, start, config.drive)
    return Row(
        key=job.key,
        mission=mission.name,
        parameters=job.parameters,
        seed=job.seed,
        reached=results[-1].reached,
        contacts=contacts,
        goal_error_m=math.hypot(truth[-1, 1] - goals[-1].x_m, truth[-1, 2] - goals[-1].y_m),
        time_s=sum(result.time_s for result in results),
        path_length_m=results[-1].path_length_m,  # all the way so far
        pose_rmse_m=float(np.sqrt(np.mean(pose_errors_m**2))) if pose_errors_m.size else math.nan,
        pose_max_m=float(pose_errors_m.max()) if pose_errors_m.size else math.nan,
        odometry_error_m=math.hypot(odometry.x_m - truth[-1, 1], odometry.y_m - truth[-1, 2]),
        odometry_error_rad=abs(wrap_angle(odometry.theta_rad - truth[-1, 3])),
        speed_error_mean_rad_s=max((side.mean_rad_s for side in sides), key=abs),
        speed_error_std_rad_s=max(side.std_rad_s for side in sides),
        reason=results[-1].reason,
    )


def _pose_errors_m(log: MissionLog, truth: FloatArray) -> FloatArray:
    """Distance of the estimate from the truth at each beat, shape (n,)."""
    poses = log.poses
    if not len(poses):
        return np.zeros(0)
    x_m = np.interp(poses[:, 0], truth[:, 0], truth[:, 1])
    y_m = np.interp(poses[:, 0], truth[:, 0], truth[:, 2])
    return np.hypot(poses[:, 1] - x_m, poses[:, 2] - y_m)


def _dead_reckoned(speeds: FloatArray, start: Pose2, drive: DriveGeometry) -> Pose2:
    """Where the wheels alone say the robot went: a measured speed is the counts of its tick."""
    pose = start
    left, right = (SPEED_COLUMNS.index(f"{side}_speed") for side in ("left", "right"))
    for before, now in itertools.pairwise(speeds):
        dt_s = now[0] - before[0]
        twist = body_twist(WheelSpeeds(left_rad_s=now[left], right_rad_s=now[right]), drive)
        pose = advance(pose, twist.v_m_s * dt_s, twist.w_rad_s * dt_s)
    return pose
