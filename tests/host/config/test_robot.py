"""The robot's TOML: valid keys are read; errors name file, key and fix."""

from pathlib import Path

import pytest

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.config.robot import (
    REMOVED_KEYS,
    RobotConfig,
    config_from_json,
    config_to_json,
    load_config,
    shared_port,
)
from thumper.runtime.assembly import open_robot


def written(folder: Path, text: str) -> Path:
    path = folder / "robot.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_no_file_gives_the_defaults() -> None:
    assert load_config(None) == RobotConfig()


def test_empty_file_gives_the_defaults(tmp_path: Path) -> None:
    assert load_config(written(tmp_path, "")) == RobotConfig()


def test_keys_are_read(tmp_path: Path) -> None:
    config = load_config(written(tmp_path, '[board]\nport = "/dev/ttyACM7"\n[lidar]\nyaw_deg = 90\n'))
    assert config.board.port == "/dev/ttyACM7"
    assert config.lidar.base_from_laser.theta_rad == pytest.approx(1.5707963)
    assert config.mapping == RobotConfig().mapping


def test_configuration_survives_a_recording(tmp_path: Path) -> None:
    text = (
        'name = "mole"\n[drive]\ntrack_m = 0.3675\n[lidar]\nmodel = "ld19"\n'
        '[mapping]\nmethod = "rbpf"\n[navigation]\nplanner="navfn"\n'
    )
    config = load_config(written(tmp_path, text))
    read = config_from_json(config_to_json(config))
    assert read == config != RobotConfig()
    assert read.drive.stated == config.drive.stated == ("track_m",)


def test_earlier_name_of_the_mapper_still_works(tmp_path: Path) -> None:
    """In the robot's file, and in recordings of earlier versions."""
    config = load_config(written(tmp_path, '[mapping]\nmethod = "graph"\nresolution_m = 0.1\n'))
    assert (config.mapping.method, config.mapping.resolution_m) == ("slam", 0.1)
    recorded = config_to_json(config).replace('"method":"slam"', '"method":"graph"')
    assert recorded != config_to_json(config)
    assert config_from_json(recorded) == config


@pytest.mark.parametrize(
    ("text", "shared"),
    [
        ("", ""),
        ('[imu]\nenabled = true\nmodel = "mpu6050"\nport = "/dev/ttyUSB0"\n', ""),
        (
            "[gps]\nenabled = true\n",
            "[gps] port /dev/ttyACM0 is also that of [lidar]",
        ),
        (
            '[lidar]\nport = "/dev/ttyUSB0"\n',
            "[lidar] port /dev/ttyUSB0 is also that of [board]",
        ),
    ],
)
def test_two_devices_on_one_port_are_named(text: str, shared: str, tmp_path: Path) -> None:
    assert shared_port(load_config(written(tmp_path, text))).split(";")[0] == shared


def test_a_run_with_two_devices_on_one_port_is_refused(tmp_path: Path) -> None:
    config = load_config(written(tmp_path, "[gps]\nenabled = true\n"))
    with pytest.raises(ThumperError, match="is also that of") as refused, open_robot(config, None):
        pass
    assert refused.value.exit_code == EXIT_USAGE


def test_masks_are_relative_to_the_file(tmp_path: Path) -> None:
    config = load_config(written(tmp_path, '[navigation.masks]\nkeepout = "kitchen.yaml"\n'))
    assert config.navigation.masks.keepout == str(tmp_path / "kitchen.yaml")
    assert config.navigation.masks.speed == ""


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("[drive]\nwheel_radius_m = -0.06\n", ["drive.wheel_radius_m", "-0.06", "must be greater than 0"]),
        ('[drive]\nwheel_radius_m = "6 cm"\n', ["drive.wheel_radius_m", "6 cm", "valid number"]),
        ("[board]\nbaud = 115200\n", ["board.baud", "115200", "500000"]),
        ("[drive]\nwheel_radius = 0.06\n", ["drive.wheel_radius", "wheel_radius_m"]),
        ("[drives]\n", ["drives", "drive"]),
        ('[drive]\nstated = ["track_m"]\n', ["unknown key drive.stated; choose from"]),
        ("[mapping.matching]\nspeed = 1\n", ["mapping.matching.speed"]),
        ("board = 3\n", ["board", "3"]),
        ('[navigation]\nplanner = "warp"\n', ["navigation", "unknown planner 'warp'", "astar"]),
        ('[navigation]\ncontroller = "warp"\n', ["navigation", "unknown controller 'warp'", "dwa"]),
        ('[navigation.recovery]\nbehaviours = ["jump"]\n', ["navigation.recovery.behaviours", "jump"]),
        ("[navigation.limits]\nv_max_m_s = 40.0\n", ["navigation.limits.v_max_m_s", "40.0", "less than"]),
        ('[bus]\ntoken = "short"\n', ["robot.toml:1: bus: a token has at least 12 characters"]),
        ('[camera]\ndetector = "chairs.onnx"\n', ["camera: detector needs enabled = true"]),
        (
            "[camera]\ndistortion = [0.1, 0.2, 0.0, 0.0]\n",
            ["camera: distortion needs 5 numbers", "4 are given"],
        ),
        (f"[camera]\ndistortion = {8 * [0.1]}\n", ["camera: distortion needs 5 numbers", "8 are given"]),
        ("# a\n[drive]\ntrack_m = 0.3\nv_mx = 1\n", ["robot.toml:4: unknown key drive.v_mx"]),
        ("[board]\n\n[navigation.limits]\n'v_max_m_s' = 40.0\n", ["robot.toml:4: navigation.limits.v_max"]),
        ("navigation.limits.v_max_m_s = nan\n", ["robot.toml:1: navigation.limits.v_max_m_s = nan"]),
        ("[navigation]\nlimits = { v_max_m_s = 40.0 }\n", ["robot.toml:2: navigation.limits.v_max_m_s"]),
        ("\n[board\n", ["robot.toml:2: not valid TOML: expected ']'"]),
        ('[bus]\ntoken = """', ["robot.toml: not valid TOML: unterminated"]),
        ("[navigation]\nv_max_m_s = 0.3\n", ["key navigation.v_max_m_s; did you mean navigation.limits.v_m"]),
        (
            "[drive]\npatience_s = 0.3\n",
            ["unknown key drive.patience_s; did you mean navigation.patience_s?"],
        ),
    ],
)
def test_errors_name_file_and_key(tmp_path: Path, text: str, named: list[str]) -> None:
    path = written(tmp_path, text)
    with pytest.raises(ThumperError) as caught:
        load_config(path)
    message = str(caught.value)
    assert "\n" not in message
    assert all(part in message for part in [str(path), *named]), message
    assert caught.value.exit_code == 2


@pytest.mark.parametrize("key", REMOVED_KEYS)
def test_a_removed_key_is_refused_with_the_fix(tmp_path: Path, key: str) -> None:
    path = written(tmp_path, f"{key} = 1\n")
    with pytest.raises(ThumperError) as caught:
        load_config(path)
    assert str(caught.value) == f"{path}:1: {key} was removed: it {REMOVED_KEYS[key]}"
    assert caught.value.exit_code == 2


def test_a_removed_table_is_refused_with_the_fix(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    removed = {"navigation.warp_drive": "left with its controller; delete the table"}
    monkeypatch.setattr("thumper.config.robot.REMOVED_KEYS", removed)
    path = written(tmp_path, "[navigation.warp_drive]\nspeed = 3.0\n")
    with pytest.raises(ThumperError) as caught:
        load_config(path)
    assert str(caught.value) == (
        f"{path}:1: navigation.warp_drive was removed: it left with its controller; delete the table"
    )


def test_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(ThumperError, match=r"none\.toml: cannot read .*\(No such file.*\); check the path"):
        load_config(tmp_path / "none.toml")
