"""What a notebook or a prompt shows of poses, scans, maps and logs fits into one short line."""

import math

import numpy as np

from thumper.common.geometry import Pose2, Twist2
from thumper.lidar.scan import Scan
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.runtime.drive_log import DriveLog


def test_poses_and_twists() -> None:
    assert repr(Pose2(x_m=1.2, y_m=0.5, theta_rad=math.radians(30.0))) == "Pose2(1.20 m, 0.50 m, 30.0°)"
    assert repr(Twist2(v_m_s=-0.25, w_rad_s=1.0)) == "Twist2(-0.25 m/s, 1.00 rad/s)"
    assert repr(Pose2(x_m=-0.001, theta_rad=-1e-5)) == "Pose2(0.00 m, 0.00 m, 0.0°)"


def test_scans() -> None:
    ranges_m = np.array([0.31, math.nan, math.inf, 3.947])
    scan = Scan(time_s=1.0, ranges_m=ranges_m, angle_min_rad=0.0, angle_increment_rad=0.1)
    assert repr(scan) == "<Scan: 2 returns of 4 beams, 0.31...3.95 m>"
    blind = Scan(time_s=1.0, ranges_m=np.array([math.inf]), angle_min_rad=0.0, angle_increment_rad=0.1)
    assert repr(blind) == "<Scan: 0 returns of 1 beams>"


def test_maps_and_logs() -> None:
    cells = np.full((40, 100), -1, dtype=np.int8)
    cells[:10] = 0
    grid = OccupancyGrid(cells=cells, resolution_m=0.05, origin_x_m=0.0, origin_y_m=0.0)
    assert repr(grid) == "<OccupancyGrid: 100 x 40 cells, 5.0 m x 2.0 m, 25 % known>"
    log = DriveLog()
    log.add_pose(0.0, Pose2())
    log.add_plan(np.zeros((2, 2)))
    assert repr(log) == "<DriveLog: 1 poses, 0 speeds, 1 plans>"
