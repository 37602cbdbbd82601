"""From the pose of the robot to the true range of each beam, with all that happens outside the lidar.

That is the mounting, the pitch of the body, surfaces without an echo, mixed pixels and self-returns. The
noise inside a lidar belongs to its model.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from thumper.common.geometry import FloatArray, Pose2
from thumper_hil.effects.echo_loss import random_runs
from thumper_hil.effects.floor_echoes import NO_RAMPS, floor_range_m, slope_toward
from thumper_hil.effects.mixed_pixels import mix_at_edges
from thumper_hil.effects.pitch import SPRINGS
from thumper_hil.effects.preset import LidarEffects
from thumper_hil.effects.self_returns import add_self_returns
from thumper_hil.effects.surfaces import echo_loss
from thumper_hil.world.echoes import WorldAt

RUN_LENGTH_BEAMS = 4.0
"""Mean length of a random drop-out."""

PoseAt = Callable[[FloatArray], FloatArray]


def _level(times_s: FloatArray) -> FloatArray:
    return np.zeros(times_s.size)


@dataclass(frozen=True, slots=True, kw_only=True)
class BeamConditions:
    """What disturbs the beams of a lidar; by default nothing does.

    `pitch_at(times_s)` returns the pitch of the body [rad], positive with the front down, shape (n,).
    `tilt_rad` is the lidar's own tilt on the body. `clock_drift` is the relative error of its clock.
    `ramps_m`, shape (n, 6), are the ramps of the floor (`thumper_hil.world.ramps`).
    """

    effects: LidarEffects | None = None
    pitch_at: Callable[[FloatArray], FloatArray] = _level
    tilt_rad: float = 0.0
    clock_drift: float = 0.0
    ramps_m: FloatArray = field(default_factory=lambda: NO_RAMPS)

    def without_mixed_pixels(self) -> "BeamConditions":
        """Return these conditions for a lidar whose own model mixes pixels."""
        return replace(self, effects=replace(self.effects, mixed_share=0.0)) if self.effects else self

    @property
    def delay_s(self) -> float:
        """Longest delay of the delivery."""
        return self.effects.delay_s if self.effects else 0.0


UNDISTURBED = BeamConditions()


@dataclass(frozen=True, slots=True, kw_only=True)
class Beams:
    """The beams of one lidar on the robot.

    `pose_at(times_s)` takes shape (n,) and returns map_from_base as rows (x_m, y_m, theta_rad), shape (n, 3).
    """

    world: WorldAt
    pose_at: PoseAt
    base_from_laser: Pose2
    range_max_m: float
    conditions: BeamConditions

    def cast(self, times_s: FloatArray, bearings_rad: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Return the range [m] of each beam at its time, shape (n,); +inf without an echo.

        Times never decrease. `bearings_rad` is in the lidar's frame, counter-clockwise from its front.
        """
        poses, mount = self.pose_at(times_s), self.base_from_laser
        cos, sin = np.cos(poses[:, 2]), np.sin(poses[:, 2])
        x_m = poses[:, 0] + cos * mount.x_m - sin * mount.y_m
        y_m = poses[:, 1] + sin * mount.x_m + cos * mount.y_m
        angles_rad = poses[:, 2] + mount.theta_rad + bearings_rad
        effects = self.conditions.effects
        if effects is None:
            return self.world.cast_at(times_s, x_m, y_m, angles_rad)
        if effects.surfaces or effects.grazing_deg < 90.0:
            echoes = self.world.echoes_at(times_s, x_m, y_m, angles_rad)
            ranges_m = echoes.range_m
            lost = echoes.incidence_rad > np.deg2rad(effects.grazing_deg)
            if effects.surfaces:
                loss = echo_loss(echoes.surface, echoes.incidence_rad, ranges_m, self.range_max_m)
                lost |= rng.random(loss.size) < loss
        else:
            ranges_m = self.world.cast_at(times_s, x_m, y_m, angles_rad)
            lost = np.zeros(ranges_m.size, np.bool_)
        pitch_rad = self.conditions.pitch_at(times_s) + self.conditions.tilt_rad
        rays, ramps_m = np.column_stack((x_m, y_m, angles_rad)), self.conditions.ramps_m
        in_body_rad = mount.theta_rad + bearings_rad
        down = np.tan(pitch_rad) * np.cos(in_body_rad)
        if len(ramps_m):  # the body leans with the floor
            to_left = slope_toward(rays[:, :2], poses[:, 2] + 0.5 * np.pi, ramps_m)
            down -= to_left * np.sin(in_body_rad)
        floor_m = floor_range_m(rays, down, SPRINGS.lidar_height_m, ramps_m)
        ranges_m = np.minimum(np.where(lost, np.inf, ranges_m), floor_m)
        ranges_m = mix_at_edges(ranges_m, self.range_max_m, effects.mixed_share, rng)
        if effects.loss_share > 0.0:
            gone = random_runs(np.full(ranges_m.size, effects.loss_share), RUN_LENGTH_BEAMS, rng)
            ranges_m = np.where(gone, np.inf, ranges_m)
        return add_self_returns(ranges_m, bearings_rad, effects.self_return_share, rng)
