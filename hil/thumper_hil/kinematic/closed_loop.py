"""Run the navigator in closed loop with a simulated base, a simulated lidar and a growing map.

Body and lidar mounting are those of the full simulator's preset (`base.py`). The navigator gets pose and
speed with errors.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.common.numba_kernel import kernel
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.costmap.inflation import IntArray
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.navigator import NavigationOutput, NavigationState, Navigator
from thumper.navigation.options import NavigationOptions
from thumper.navigation.state import Transition
from thumper_hil.bench.hardware import BASE_FROM_LASER
from thumper_hil.effects.mounting import true_mounting
from thumper_hil.effects.preset import load_preset
from thumper_hil.kinematic.base import DELAY_S, TICK_S, KinematicBase
from thumper_hil.kinematic.world import KinematicWorld

CYCLE_TICKS = 5


@kernel
def trace_beams(
    observed: IntArray, hits: IntArray, start: FloatArray, ends: FloatArray, is_hit: FloatArray, cell_m: float
) -> None:
    """Count the beams that cross or end in each cell; positions are relative to the grid's corner."""
    rows, cols = observed.shape
    for i in range(ends.shape[0]):
        length = math.hypot(ends[i, 0] - start[0], ends[i, 1] - start[1])
        count = max(1, math.ceil(2.0 * length / cell_m))
        last = -1
        for k in range(count + 1):
            x = start[0] + (ends[i, 0] - start[0]) * k / count
            y = start[1] + (ends[i, 1] - start[1]) * k / count
            col, row = math.floor(x / cell_m), math.floor(y / cell_m)
            if 0 <= row < rows and 0 <= col < cols and row * cols + col != last:
                last = row * cols + col
                observed[row, col] += 1
        col, row = math.floor(ends[i, 0] / cell_m), math.floor(ends[i, 1] / cell_m)
        if is_hit[i] > 0.0 and 0 <= row < rows and 0 <= col < cols:
            hits[row, col] += 1


class CountingMap:
    """An occupancy map of hits per observation."""

    def __init__(self, x_m: float, y_m: float, width_m: float, height_m: float, cell_m: float = 0.05) -> None:
        shape = (round(height_m / cell_m), round(width_m / cell_m))
        self._observed, self._hits = np.zeros(shape, np.int32), np.zeros(shape, np.int32)
        self._corner, self._cell_m = np.array((x_m, y_m)), cell_m

    def integrate(self, laser: Pose2, ends_m: FloatArray, is_hit: FloatArray) -> None:
        """Add one scan with its end points in the map frame."""
        start = np.array((laser.x_m, laser.y_m)) - self._corner
        trace_beams(self._observed, self._hits, start, ends_m - self._corner, is_hit, self._cell_m)

    def grid(self) -> OccupancyGrid:
        """Return the current map."""
        percent = 100 * self._hits // np.maximum(self._observed, 1)
        return OccupancyGrid(
            cells=np.where(self._observed > 0, percent, -1).astype(np.int8),
            resolution_m=self._cell_m,
            origin_x_m=float(self._corner[0]),
            origin_y_m=float(self._corner[1]),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Conditions:
    """How hard the robot is to drive."""

    preset: str = "nominal"
    delay_s: float = DELAY_S
    range_noise_m: float = 0.01
    range_max_m: float = 4.0
    beams: int = 240
    pose_noise_m: float = 0.005
    pose_noise_rad: float = 0.005
    known_start: bool = False  # the lidar has looked all around from the start before the drive begins


@dataclass(slots=True, kw_only=True)
class Run:
    """The result of a drive."""

    state: NavigationState = NavigationState.IDLE
    reason: str = ""
    time_s: float = 0.0
    length_m: float = 0.0
    clearance_m: float = math.inf
    goal_error_m: float = math.inf
    track: list[Pose2] = field(default_factory=list)
    outputs: list[NavigationOutput] = field(default_factory=list)
    transitions: tuple[Transition, ...] = ()


def drive(
    world: KinematicWorld | Callable[[float], KinematicWorld],
    start: Pose2,
    goal: Goal,
    area: tuple[float, float, float, float],
    *,
    seed: int = 0,
    options: NavigationOptions | None = None,
    conditions: Conditions | None = None,
    limit_s: float = 60.0,
) -> Run:
    """Drive to a goal in a static world or in one given by time; `area` is x, y, width, height of the map."""
    given, rng, footprint = conditions or Conditions(), np.random.default_rng(seed), Footprint()
    world_at = world if callable(world) else lambda _time_s: world
    navigator = Navigator(options or NavigationOptions(), footprint)
    navigator.set_goal(goal)
    grid_map = CountingMap(*area)
    base = KinematicBase(start, preset=given.preset, seed=seed, delay_s=given.delay_s)
    mounting = true_mounting(BASE_FROM_LASER, load_preset(given.preset).mount, seed)
    laser = mounting.base_from_laser
    run, output = Run(), NavigationOutput()
    if given.known_start:
        for theta_rad in (0.5 * math.pi, math.pi, -0.5 * math.pi):
            _observe(world_at(0.0), start @ Pose2(theta_rad=theta_rad), laser, grid_map, given, rng)
    for tick in range(round(limit_s / TICK_S)):
        run.time_s = tick * TICK_S
        now = world_at(run.time_s)
        run.clearance_m = min(run.clearance_m, now.clearance_m(base.pose, footprint))
        if tick % CYCLE_TICKS == 0:
            map_from_base, hits_m = _observe(now, base.pose, laser, grid_map, given, rng)
            output = navigator.update(
                run.time_s, map_from_base, _measured(base.twist, rng), grid_map.grid(), hits_m
            )
            run.outputs.append(output)
            run.track.append(base.pose)
            ended = output.state in (NavigationState.REACHED, NavigationState.FAILED)
            if (ended and abs(base.twist.v_m_s) < 1e-3) or run.clearance_m < 0.0:
                break
        base.step(output.command)
        run.length_m += abs(base.twist.v_m_s) * TICK_S
    run.state, run.reason = output.state, output.reason
    run.goal_error_m = goal.distance_m(base.pose)
    run.transitions = navigator.transitions
    return run


def _measured(twist: Twist2, rng: np.random.Generator) -> Twist2:
    """Return the twist with measurement noise."""
    return Twist2(
        v_m_s=twist.v_m_s + 0.01 * rng.standard_normal(), w_rad_s=twist.w_rad_s + 0.02 * rng.standard_normal()
    )


def _observe(
    world: KinematicWorld,
    pose: Pose2,
    base_from_laser: Pose2,
    grid_map: CountingMap,
    given: Conditions,
    rng: np.random.Generator,
) -> tuple[Pose2, FloatArray]:
    """Take a scan, add it to the map, and return the noisy pose and the hits in map, shape (n, 2).

    The lidar is at `base_from_laser`; the robot takes it to be where its TOML says.
    """
    noise = rng.standard_normal(3) * (given.pose_noise_m, given.pose_noise_m, given.pose_noise_rad)
    map_from_base = pose @ Pose2(x_m=noise[0], y_m=noise[1], theta_rad=noise[2])
    angles_rad = np.linspace(-math.radians(120.0), math.radians(120.0), given.beams)
    ranges_m = world.cast(pose @ base_from_laser, angles_rad, given.range_max_m)
    ranges_m = ranges_m + given.range_noise_m * rng.standard_normal(ranges_m.size)
    laser = map_from_base @ BASE_FROM_LASER
    is_hit = np.isfinite(ranges_m)
    reach_m = np.where(is_hit, ranges_m, given.range_max_m)
    ends_m = laser.apply(np.column_stack((reach_m * np.cos(angles_rad), reach_m * np.sin(angles_rad))))
    grid_map.integrate(laser, ends_m, is_hit.astype(np.float64))
    return map_from_base, ends_m[is_hit]
