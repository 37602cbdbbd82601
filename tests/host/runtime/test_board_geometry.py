"""The robot takes encoder and wheels from the board, unless the configuration sets them."""

from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import pytest

from thumper.board.messages import BoardModel, Identity, ParameterSource, ResetCause
from thumper.camera.dock_options import DockOptions
from thumper.common.errors import ThumperError
from thumper.config.robot import DriveOptions, load_config
from thumper.navigation.speed_limits import SpeedLimits
from thumper.runtime.assembly import check_braking, geometry_of
from thumper.runtime.service.low_battery import check_low_battery

BOARD = Identity(
    schema_hash=0,
    version_major=0,
    version_minor=2,
    version_patch=0,
    board=BoardModel.NANO,
    control_rate_Hz=10,
    reset_cause=ResetCause.POWER_ON,
    counts_per_rev=1920,
    wheel_radius_mm=33,
    track_mm=160,
    reversed_sides=0,
    battery_cells=2,
    battery_stop_mV=3200,
    battery_rearm_mV=3500,
    current_scale=25_000,
    current_zero=511,
    pwm_frequency_Hz=122,
    parameters=ParameterSource.SAVED,
)


def test_defaults_follow_the_board() -> None:
    found = geometry_of(DriveOptions(track_m=0.2), BOARD)
    assert (found.wheel_radius_m, found.counts_per_rev, found.track_m) == (0.033, 1920, 0.2)


def test_the_track_follows_the_board() -> None:
    assert geometry_of(DriveOptions(), BOARD).track_m == 0.16


@pytest.mark.parametrize("track_m", [0.14, 0.41])
def test_a_track_that_slip_cannot_explain_is_refused(track_m: float) -> None:
    with pytest.raises(ThumperError, match="the board is set to a track of 160 mm, the configuration says"):
        geometry_of(DriveOptions(track_m=track_m), BOARD)


def test_a_calibrated_radius_stays() -> None:
    assert geometry_of(DriveOptions(wheel_radius_m=0.0328), BOARD).wheel_radius_m == 0.0328


@pytest.mark.parametrize("drive", [DriveOptions(wheel_radius_m=0.04), DriveOptions(counts_per_rev=1000)])
def test_a_contradiction_is_refused(drive: DriveOptions) -> None:
    with pytest.raises(ThumperError, match="the board is set to 1920 counts per revolution"):
        geometry_of(drive, BOARD)


def test_the_default_robot_keeps_its_defaults() -> None:
    board = replace(BOARD, counts_per_rev=1200, wheel_radius_mm=62, track_mm=245)
    assert geometry_of(DriveOptions(), board) == DriveOptions()


@pytest.mark.parametrize(
    ("line", "board"),
    [
        ("counts_per_rev = 1200", BOARD),
        ("wheel_radius_m = 0.062", BOARD),
        ("track_m = 0.3675", replace(BOARD, track_mm=100)),
    ],
)
def test_a_default_that_the_file_states_is_no_default(line: str, board: Identity, tmp_path: Path) -> None:
    path = tmp_path / "robot.toml"
    path.write_text(f"[drive]\n{line}\n", encoding="utf-8")
    with pytest.raises(ThumperError, match="the board is set to"):
        geometry_of(load_config(path).drive, board)


def test_after_the_first_board_another_one_is_a_contradiction() -> None:
    settled = geometry_of(DriveOptions(), replace(BOARD, counts_per_rev=1200, wheel_radius_mm=62))
    with pytest.raises(ThumperError, match="the board is set to 1920 counts per revolution"):
        geometry_of(settled, BOARD)


@pytest.mark.parametrize("low_battery_V", [0.1, 6.4])
def test_a_low_battery_that_the_board_does_not_reach_is_refused(low_battery_V: float) -> None:
    with pytest.raises(ThumperError, match=r"the board stops the motors at 6\.4 V"):
        check_low_battery(DockOptions(low_battery_V=low_battery_V), BOARD)


@pytest.mark.parametrize("low_battery_V", [0.0, 6.5])
def test_other_limits_of_the_battery_are_accepted(low_battery_V: float) -> None:
    check_low_battery(DockOptions(low_battery_V=low_battery_V), BOARD)


@pytest.mark.parametrize(
    ("acceleration", "deceleration", "fits"),
    [(8.0, 16.0, True), (8.0, 8.0, False), (8.0, 0.0, False), (20.0, 0.0, True), (0.0, 8.0, True)],
)
def test_a_board_that_brakes_more_slowly_than_the_monitor_expects_is_refused(
    acceleration: float, deceleration: float, fits: bool
) -> None:
    """Deceleration 0 is as acceleration; acceleration 0 is no ramp at all."""
    with nullcontext() if fits else pytest.raises(ThumperError, match="brakes its wheels with 8 rad/s"):
        check_braking(SpeedLimits(), acceleration, deceleration)
