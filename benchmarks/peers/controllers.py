"""Run ROS's inflation and DWA critics and ours in turn on the same windows: `make bench-peers`.

Run: python -m benchmarks.peers.controllers [--rounds 20]

The windows are recorded costmaps of 6 m x 6 m. A cycle of DWA scores 2020 velocities over 20 steps, each
checked with the whole outline. Each round runs each program once, one after the other. Times are CPU
milliseconds of this thread. A ratio is ours over ROS's in one round; behind it are the least and the greatest
of all rounds.
"""

import argparse
import ctypes
import subprocess
import sys
import time
from collections.abc import Callable
from functools import partial

import numpy as np
from benchmarks.figure import figure, has_data
from benchmarks.navigation import DATA, NO_HITS, PEER_COSTS, window_request
from benchmarks.peers.sources import build_dwa
from numpy.typing import NDArray

from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.controllers.controller import ControlRequest
from thumper.navigation.controllers.dwa import DwaController, DwaOptions
from thumper.navigation.controllers.rotate_in_place import RotateInPlaceOptions
from thumper.navigation.costmap.costmap import build_costmap
from thumper.navigation.costmap.inflation import LETHAL
from thumper.navigation.footprint import Footprint
from thumper.navigation.speed_limits import SpeedLimits
from thumper_hil.kinematic.maps import ROS_FOOTPRINT

V_SAMPLES, W_SAMPLES, HORIZON_S, STEP_S = 20, 101, 2.0, 0.1
WINDOWS = ("open", "median", "tight")
DOUBLES = ctypes.POINTER(ctypes.c_double)


def _doubles(values: NDArray[np.float64]) -> "ctypes._Pointer[ctypes.c_double]":
    return np.ascontiguousarray(values, dtype=np.float64).ctypes.data_as(DOUBLES)


class RosInflation:
    """costmap_2d's inflation layer on one window; `lethal` has a value for each cell.

    For the narrow outline: the inscribed radius of ours is three cells exactly, where rounding decides.
    """

    def __init__(self, lib: ctypes.CDLL, lethal: NDArray[np.bool_], resolution_m: float) -> None:
        lib.inflation_new.restype = ctypes.c_void_p
        rows, columns = lethal.shape
        corners = ROS_FOOTPRINT.polygon_m()
        options = (PEER_COSTS.inflation_radius_m, PEER_COSTS.decay_per_m)
        resolution = ctypes.c_double(resolution_m)
        self._layer = ctypes.c_void_p(
            lib.inflation_new(
                columns, rows, resolution, _doubles(corners), len(corners), *map(ctypes.c_double, options)
            )
        )
        self._lib, self._lethal = lib, np.where(lethal, LETHAL, 0).astype(np.uint8)
        self.costs = np.empty_like(self._lethal)

    def __call__(self) -> None:
        self._lib.inflation_run(
            self._layer, *(a.ctypes.data_as(ctypes.c_char_p) for a in (self._lethal, self.costs))
        )


class RosDwa:
    """The critics of dwa_local_planner on the window of a request."""

    def __init__(self, lib: ctypes.CDLL, request: ControlRequest, limits: SpeedLimits) -> None:
        lib.dwa_new.restype = ctypes.c_void_p
        rows, columns = request.costmap.costs.shape
        costs = np.ascontiguousarray(request.costmap.costs).ctypes.data_as(ctypes.c_char_p)
        most = np.array((request.v_limit_m_s, limits.w_max_rad_s, limits.v_accel_m_s2, limits.w_accel_rad_s2))
        times = map(ctypes.c_double, (request.costmap.resolution_m, HORIZON_S, STEP_S))
        self._dwa = ctypes.c_void_p(lib.dwa_new(costs, columns, rows, *times, _doubles(most)))
        self._lib, self._request, self._corners = lib, request, Footprint().polygon_m()

    def __call__(self) -> int:
        """Run one cycle; return the number of scored samples."""
        request = self._request
        pose, path_m = request.map_from_base, request.path_m
        return int(
            self._lib.dwa_run(
                self._dwa,
                _doubles(np.array((pose.x_m, pose.y_m, pose.theta_rad))),
                ctypes.c_double(request.twist.v_m_s),
                V_SAMPLES,
                W_SAMPLES,
                *(_doubles(self._corners), len(self._corners)),
                *(_doubles(path_m), len(path_m)),
            )
        )


def report(what: str, ours: Callable[[], object], ros: Callable[[], object], rounds: int) -> None:
    """Run both in turn and print the times and their ratio."""
    times_ms = np.zeros((rounds + 1, 2))
    for turn in range(rounds + 1):
        for k, work in enumerate((ours, ros)):
            begun_s = time.thread_time()
            work()
            times_ms[turn, k] = 1e3 * (time.thread_time() - begun_s)
    times_ms = times_ms[1:]  # the first round loads kernels
    ratios = times_ms[:, 0] / times_ms[:, 1]
    ours_ms, ros_ms = np.median(times_ms, axis=0)
    spread = f"x {np.median(ratios):.2f} ({ratios.min():.2f} to {ratios.max():.2f})"
    figure(f"{what}: ours / ROS's", f"{ours_ms:.2f} / {ros_ms:.2f} ms; {spread}")


def main() -> int:
    """Build the peers, run them beside ours and print the ratios."""
    parser = argparse.ArgumentParser(description="our inflation and DWA beside ROS's, in turn")
    parser.add_argument("--rounds", type=int, default=20)
    rounds = parser.parse_args().rounds
    if not has_data(DATA):
        return 0
    try:
        lib = ctypes.CDLL(str(build_dwa()))
    except (subprocess.CalledProcessError, FileNotFoundError) as error:
        print(f"ROS's DWA cannot be fetched or built: {error}", file=sys.stderr)
        return 1
    footprint, limits = Footprint(), SpeedLimits()
    options = DwaOptions(v_samples=V_SAMPLES, w_samples=W_SAMPLES, horizon_s=HORIZON_S)
    for name in WINDOWS:
        request = window_request(name)
        lethal = request.costmap.costs == LETHAL
        cells = np.where(lethal, 100, 0).astype(np.int8)
        grid = OccupancyGrid(cells=cells, resolution_m=0.05, origin_x_m=0.0, origin_y_m=0.0)
        inflation = RosInflation(lib, lethal, grid.resolution_m)
        inflate = partial(build_costmap, grid, NO_HITS, ROS_FOOTPRINT, PEER_COSTS)
        report(f"inflation, {name} window", inflate, inflation, rounds)
        differing = int(np.count_nonzero(np.abs(inflation.costs.astype(int) - inflate().costs) > 1))
        dwa = RosDwa(lib, request, limits)
        controller = DwaController(options, RotateInPlaceOptions(), limits, footprint)
        report(f"DWA cycle, {name} window", partial(controller.compute_command, request), dwa, rounds)
        print(f"  {differing} of {lethal.size} costs differ by more than 1; ROS scored {dwa()} samples")
    return 0


if __name__ == "__main__":
    sys.exit(main())
