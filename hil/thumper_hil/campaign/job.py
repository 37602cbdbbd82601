"""Run one job of a campaign in a worker: a mission with the whole robot, reduced to a row."""

import itertools
import math
from dataclasses import replace

import numpy as np

from thumper.common.errors import ThumperError
from thumper.common.geometry import FloatArray, Pose2, wrap_angle
from thumper.common.kinematics import DriveGeometry, WheelSpeeds, body_twist
from thumper.config.robot import RobotConfig, config_from_json, with_ports
from thumper.navigation.goal import Goal
from thumper.odometry.pose_buffer import interpolate_poses
from thumper.odometry.wheel_odometry import advance
from thumper.runtime.assembly import open_robot
from thumper.runtime.drive.tasks import drive_to_goal
from thumper.runtime.drive_log import SPEED_COLUMNS, DriveLog, speed_errors
from thumper.runtime.drive_result import DriveResult
from thumper_hil.bench import Bench
from thumper_hil.bench.registry import close_device, forget_simulation, open_device
from thumper_hil.campaign.job_digest import content_digest
from thumper_hil.campaign.result_row import CampaignRow
from thumper_hil.campaign.spec import CampaignJob, mission_of_seed

DEVICE = "campaign"
"""Device name under which a job opens the simulated robot, in addition to board and lidar."""


def run_job(job: CampaignJob) -> CampaignRow:
    """Drive the mission and return its row; a drive that the robot refuses or aborts is a row, too.

    Raises
    ------
    ThumperError
        This computer cannot simulate the job: a part is not built, or a file is missing or differs from the
        one at the start of the campaign. This is not a result of the robot, so there is no row.
    """
    config = config_from_json(job.robot_json)
    if content_digest(job.mission.world, job.scenario, config) != job.content:
        raise ThumperError(
            "its world, scenario or mask files differ from those at the start of the campaign; copy the same "
            "files to every computer, and start a new campaign after you edit one"
        )
    mission = mission_of_seed(job.mission, job.seed)
    assert mission.start is not None  # `load_campaign` checks it
    x_m, y_m, yaw_deg = mission.start
    options = {"world": mission.world, "x_m": x_m, "y_m": y_m, "yaw_deg": yaw_deg, "seed": job.seed}
    options |= {"lidar": config.lidar.model, "scenario": job.scenario, "preset": job.preset}
    name = job.key.replace("/", "~")
    bench = open_device(name, DEVICE, {key: str(value) for key, value in options.items()})
    try:
        return _drive(
            replace(job, mission=mission),
            with_ports(config, board=f"sim://{name}/board", lidar=f"sim://{name}/lidar"),
            bench,
        )
    except ThumperError as error:
        return CampaignRow(
            key=job.key,
            mission=mission.name,
            parameters=job.parameters,
            seed=job.seed,
            reached=False,
            contacts=bench.contacts,
            touches_by_people=bench.touches_by_people,
            reason=str(error),
        )
    finally:
        close_device(name, DEVICE)
        forget_simulation(name)


def _drive(job: CampaignJob, config: RobotConfig, bench: Bench) -> CampaignRow:
    mission = job.mission
    assert mission.start is not None
    assert mission.goal is not None
    x_m, y_m, yaw_deg = mission.start
    start = Pose2(x_m=x_m, y_m=y_m, theta_rad=math.radians(yaw_deg))
    goals = [Goal(x_m=x_m, y_m=y_m) for x_m, y_m in (*mission.via, mission.goal)]
    with open_robot(config, start) as robot:
        result: DriveResult | None = None
        for goal in goals:
            result = robot.run(drive_to_goal(goal, mission.name)).after(result)
            if not result.reached:
                break
        assert result is not None  # every mission has a goal
        truth, contacts, touches = bench.truth(), bench.contacts, bench.touches_by_people
    pose_errors_m = _pose_errors_m(robot.log, truth)
    sides = speed_errors(robot.log.speeds).values()
    odometry = _dead_reckoning(robot.log.speeds, start, config.drive)
    return CampaignRow(
        key=job.key,
        mission=mission.name,
        parameters=job.parameters,
        seed=job.seed,
        reached=result.reached,
        contacts=contacts,
        touches_by_people=touches,
        goal_error_m=math.hypot(truth[-1, 1] - goals[-1].x_m, truth[-1, 2] - goals[-1].y_m),
        time_s=result.time_s,
        path_length_m=result.path_length_m,
        pose_rmse_m=float(np.sqrt(np.mean(pose_errors_m**2))) if pose_errors_m.size else math.nan,
        pose_max_m=float(pose_errors_m.max()) if pose_errors_m.size else math.nan,
        odometry_error_m=math.hypot(odometry.x_m - truth[-1, 1], odometry.y_m - truth[-1, 2]),
        odometry_error_rad=abs(wrap_angle(odometry.theta_rad - truth[-1, 3])),
        speed_error_mean_rad_s=max((side.mean_rad_s for side in sides), key=abs),
        speed_error_std_rad_s=max(side.std_rad_s for side in sides),
        reason=result.reason,
    )


def _pose_errors_m(log: DriveLog, truth: FloatArray) -> FloatArray:
    """Return the distance between estimate and truth at each control cycle, shape (n,)."""
    poses = log.poses
    if not len(poses):
        return np.zeros(0)
    true_poses = interpolate_poses(poses[:, 0], truth[:, 0], truth[:, 1:])
    return np.asarray(np.hypot(*(poses[:, 1:3] - true_poses[:, :2]).T))


def _dead_reckoning(speeds: FloatArray, start: Pose2, drive: DriveGeometry) -> Pose2:
    """Return the final pose from the wheel speeds alone; a measured speed is the counts of its tick."""
    pose = start
    left, right = (SPEED_COLUMNS.index(f"{side}_speed") for side in ("left", "right"))
    for before, now in itertools.pairwise(speeds):
        dt_s = now[0] - before[0]
        twist = body_twist(WheelSpeeds(left_rad_s=now[left], right_rad_s=now[right]), drive)
        pose = advance(pose, twist.v_m_s * dt_s, twist.w_rad_s * dt_s)
    return pose
