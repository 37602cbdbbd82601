"""Build the simulated robot's parts as hard as the preset says: its parameters and its lidar."""

from dataclasses import replace

import numpy as np

from thumper.common.geometry import Pose2
from thumper_hil.bench.body_trajectory import BodyTrajectory
from thumper_hil.bench.options import BenchOptions
from thumper_hil.chip.robot_params import RobotParams
from thumper_hil.effects.clock_drift import clock_drifts
from thumper_hil.effects.friction import floor_friction
from thumper_hil.effects.mounting import true_mounting
from thumper_hil.effects.preset import LidarEffects, Preset
from thumper_hil.effects.tyres import rolling_radius_m
from thumper_hil.lidars.a5_device import A5Device
from thumper_hil.lidars.beams import UNDISTURBED, BeamConditions
from thumper_hil.lidars.ld19 import Ld19
from thumper_hil.lidars.rplidar import RplidarA1, RplidarA2, RplidarC1
from thumper_hil.lidars.urg04lx import Urg04Lx
from thumper_hil.lidars.ydlidar_x4 import YdlidarX4
from thumper_hil.world.house import house_number, is_carpeted
from thumper_hil.world.world import World
from thumper_hil.world.world_history import WorldHistory

LIDAR_MODELS = {
    "urg04lx": Urg04Lx,
    "ld19": Ld19,
    "rplidar_a1": RplidarA1,
    "rplidar_a2": RplidarA2,
    "rplidar_c1": RplidarC1,
    "ydlidar_x4": YdlidarX4,
}
BASE_FROM_LASER = Pose2(x_m=0.12)
SILENT = LidarEffects(
    delay_s=0.0, mixed_share=0.0, loss_share=0.0, grazing_deg=90.0, surfaces=True, self_return_share=0.0
)
"""Effects that change nothing in a world of matt surfaces."""


def robot_params(options: BenchOptions, preset: Preset) -> RobotParams:
    """Return the parameters of the robot with this seed on the preset's floor."""
    params, body = RobotParams.load(), preset.body
    battery = params.battery
    if options.charge is not None:
        battery = replace(battery, state_of_charge=options.charge)
    return replace(
        params,
        battery=battery,
        body=replace(
            params.body,
            friction=floor_friction(options.floor or _floor_of(options.world, preset)),
            wheel_radius_m=rolling_radius_m(params.body.wheel_radius_m, body, options.seed),
            centre_offset_m=body.centre_offset_m,
            centre_wander_m=body.centre_wander_m,
        ),
        board=replace(params.board, clock_drift=clock_drifts(preset.clock, options.seed)[0]),
    )


def _floor_of(world: str, preset: Preset) -> str:
    number = house_number(world)
    if number is not None and is_carpeted(preset.house.carpet_share, number):
        return "carpet"
    return preset.body.floor


def make_lidar(
    options: BenchOptions, preset: Preset, world: World, history: WorldHistory, track: BodyTrajectory
) -> A5Device | Ld19 | Urg04Lx:
    """Return the lidar of the robot with this seed, mounted as the preset says."""
    mounting = true_mounting(BASE_FROM_LASER, preset.mount, options.seed)
    has_surfaces = bool(np.any(world.segment_surfaces) or np.any(world.circle_surfaces))
    is_level = preset.body.pitch_deg_per_m_s2 == preset.body.pitch_noise_deg == preset.mount.tilt_deg == 0.0
    conditions = UNDISTURBED
    is_flat = not (world.sills_m.size or world.ramps_m.size)
    if has_surfaces or not is_flat or preset.lidar != SILENT or not is_level:
        conditions = BeamConditions(
            effects=preset.lidar,
            pitch_at=track.pitch_at,
            tilt_rad=mounting.tilt_rad,
            ramps_m=world.ramps_m,
        )
    lidar: A5Device | Ld19 | Urg04Lx = LIDAR_MODELS[options.lidar](
        world=history,
        pose_at=track.pose_at,
        base_from_laser=mounting.base_from_laser,
        seed=options.seed,
        conditions=replace(conditions, clock_drift=clock_drifts(preset.clock, options.seed)[1]),
    )
    return lidar
