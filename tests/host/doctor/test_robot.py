"""`thumper doctor` on a simulated robot: its measurements and the defects it finds."""

import json
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import serial
from typer.testing import CliRunner

from tests.variants import some_of
from thumper.cli.app import build_app
from thumper_hil.chip.robot_params import RobotParams
from thumper_hil.lidars.rplidar import RplidarC1


def diagnose(*arguments: str, answer: str = "y\n") -> tuple[int, list[dict[str, Any]]]:
    """Run the doctor for one second per link; return its exit code and its checks."""
    seconds = [] if "--seconds" in arguments else ["--seconds", "1"]
    done = CliRunner().invoke(build_app(), ["doctor", *seconds, "--json", *arguments], input=answer)
    report = json.loads(done.stdout)
    assert report["ok"] == (done.exit_code == 0)
    checks: list[dict[str, Any]] = report["checks"]
    return done.exit_code, checks


def line(checks: list[dict[str, Any]], *words: str) -> dict[str, Any]:
    """Return the check that contains all the words."""
    (found,) = [check for check in checks if all(word in check["what"] for word in words)]
    return found


def test_a_healthy_robot_passes() -> None:
    code, checks = diagnose("--board", "sim://d1/board?floor=stand", "--lidar", "sim://d1/lidar", "--spin")
    assert code == 0
    for words in (("board", "round trip"), ("telemetry", "Hz"), ("telemetry", "lost"), ("scans", "Hz")):
        assert line(checks, *words)["verdict"] == "pass"
    for side in ("left", "right"):
        assert line(checks, f"{side} motor forward")["verdict"] == "pass"


def test_the_shortest_simulated_robot_has_its_lidar_checked() -> None:
    code, checks = diagnose("--board", "sim://")
    assert code == 0
    assert line(checks, "scans", "Hz")["verdict"] == "pass"


def test_only_hardware_has_usb_devices_to_check(tmp_path: Path) -> None:
    """Of two simulated ports, one may be a terminal of `thumper sim`."""
    config = tmp_path / "robot.toml"
    config.write_text('[board]\nport = "sim://d9/board"\n[lidar]\nport = "sim://d9/lidar"\n')
    gps = tmp_path / "gps.toml"
    gps.write_text('[gps]\nenabled = true\nport = "/dev/ttyACM7"\n')
    terminal = os.ttyname(os.openpty()[1])
    for arguments, is_hardware in (
        ((), True),
        (("--board", "sim://"), False),
        (("--config", str(config)), False),
        (("--config", str(config), "--lidar", terminal), False),
        (("--config", str(gps), "--board", terminal, "--lidar", "sim://"), True),
        (("--config", str(config), "--lidar", "/dev/ttyACM7"), True),
    ):
        _, checks = diagnose(*arguments)
        of_usb = [check for check in checks if "udev" in check["what"] or "thumper.service" in check["what"]]
        assert len(of_usb) == (2 if is_hardware else 0), arguments


def test_speeds_are_printed_while_the_wheels_turn() -> None:
    arguments = ["doctor", "--seconds", "1", "--board", "sim://d10/board?floor=stand", "--speeds"]
    done = CliRunner().invoke(build_app(), [*arguments, "--spin"], input="y\n")
    rows = [row.split()[1:] for row in done.stderr.splitlines() if row.startswith("wheels ")]
    assert {len(row) for row in rows} == {7}
    assert max(float(row[1]) for row in rows) > 1000 < max(float(row[4]) for row in rows)
    without = CliRunner().invoke(build_app(), arguments)
    assert without.exception is not None
    assert "--speeds needs --spin" in str(without.exception)


def test_open_ground_is_no_defect_and_the_doctor_says_what_it_means() -> None:
    code, checks = diagnose("--board", "sim://d5/board?world=yard&y_m=-8", "--lidar", "sim://d5/lidar")
    assert code == 0
    assert "outdoors this is normal, but here no scan can be matched" in line(checks, "with a return")["fix"]


def test_wheels_do_not_turn_without_consent() -> None:
    code, checks = diagnose("--board", "sim://d2/board", "--spin", answer="n\n")
    assert code == 0
    assert line(checks, "not checked")["verdict"] == "warn"
    assert not any("motor forward" in check["what"] for check in checks)


def test_a_reversed_encoder_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """Channels A and B are exchanged: the wheel turns forward and the count falls."""
    intact = RobotParams.load()
    swapped = replace(intact, encoder=replace(intact.encoder, counts_per_rev=-intact.encoder.counts_per_rev))
    monkeypatch.setattr(RobotParams, "load", lambda: swapped)
    code, checks = diagnose("--board", "sim://d3/board?floor=stand", "--spin")
    assert code == 4
    check = line(checks, "left motor forward")
    assert check["verdict"] == "fail"
    assert "exchange wires A and B" in check["fix"]


@pytest.mark.parametrize("fault", ['encoder.left.b = "cut"', 'motor.left = "dead"'])
def test_a_dead_side_is_named(tmp_path: Path, fault: str) -> None:
    scenario = tmp_path / "fault.toml"
    scenario.write_text(f"faults = [ {{ at_s = 0.0, {fault} }} ]\n")
    code, checks = diagnose("--board", f"sim://d4/board?floor=stand&scenario={scenario}", "--spin")
    assert code == 4
    assert "dead" in line(checks, "left motor forward")["fix"]
    assert line(checks, "right motor forward")["verdict"] == "pass"


def test_a_noisy_line_and_an_empty_battery_are_named(tmp_path: Path) -> None:
    scenario = tmp_path / "fault.toml"
    scenario.write_text("faults = [ { at_s = 0.5, line.noise = 0.0005 } ]\n")
    _, checks = diagnose("--board", f"sim://d5/board?scenario={scenario}", "--seconds", "10")
    assert line(checks, "telemetry", "lost")["verdict"] != "pass"
    code, checks = diagnose("--board", "sim://d6/board?charge=0.01")
    assert code == 4
    assert "charge" in line(checks, "battery")["fix"]


def test_the_configuration_sets_ports_and_lidar_model(tmp_path: Path) -> None:
    config = tmp_path / "robot.toml"
    config.write_text(
        '[board]\nport = "sim://d7/board?lidar=ld19"\n[lidar]\nport = "sim://d7/lidar"\nmodel = "ld19"\n'
    )
    code, checks = diagnose("--config", str(config))
    assert code == 0
    assert "100 %" in line(checks, "beams")["what"]


@pytest.mark.parametrize("model", some_of(["rplidar_a1", "ydlidar_x4", "rplidar_a2", "rplidar_c1"], 2))
def test_a_lidar_is_asked_what_it_is(tmp_path: Path, model: str) -> None:
    config = tmp_path / "robot.toml"
    port = f"sim://ask{model}/lidar?lidar={model}"
    code, checks = diagnose("--lidar", port)
    assert code == 4
    assert f'set [lidar] model = "{model}"' in line(checks, "lidar")["fix"]
    board = f"sim://has{model}/board?lidar={model}"
    config.write_text(
        f'[board]\nport = "{board}"\n[lidar]\nport = "sim://has{model}/lidar"\nmodel = "{model}"\n'
    )
    _, checks = diagnose("--config", str(config))
    name = model.replace("_", " ").upper()
    assert line(checks, name, "firmware")["verdict"] == "pass"
    assert line(checks, "scans", "lost")["verdict"] == "pass"
    assert line(checks, "scans", "Hz of")["verdict"] == "pass"


@pytest.mark.parametrize("model", ["urg04lx", "ld19"])
def test_a_lidar_without_that_request_is_found_too(tmp_path: Path, model: str) -> None:
    config = tmp_path / "robot.toml"
    config.write_text(f'[lidar]\nport = "sim://find{model}/lidar?lidar={model}"\nmodel = "rplidar_c1"\n')
    _, checks = diagnose("--config", str(config))
    assert f'set [lidar] model = "{model}"' in line(checks, "lidar")["fix"]


@pytest.mark.parametrize("model", ["urg04lx", "rplidar_a2", "rplidar_c1"])
def test_a_lidar_of_an_unknown_model_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, model: str
) -> None:
    monkeypatch.setattr(RplidarC1, "figures", replace(RplidarC1.figures, model=0x61))
    config = tmp_path / "robot.toml"
    port = f"sim://unknown{model}/lidar?lidar=rplidar_c1"
    config.write_text(f'[lidar]\nport = "{port}"\nmodel = "{model}"\n')
    code, checks = diagnose("--lidar", port, "--config", str(config))
    assert code == 4
    assert line(checks, "lidar")["fix"] == (
        f"the lidar on {port} answers with model number 97 and firmware 1.2, a model that thumper does not "
        "know; of its family it knows RPLIDAR A1, RPLIDAR A2, RPLIDAR C1, YDLIDAR X4"
    )


def test_a_gyroscope_that_the_board_does_not_use_is_a_failed_check(tmp_path: Path) -> None:
    config = tmp_path / "robot.toml"
    config.write_text('[imu]\nenabled = true\nmodel = "mpu6050"\n')
    code, checks = diagnose(
        "--board", "sim://gyro/board", "--lidar", "sim://gyro/lidar", "--config", str(config)
    )
    assert code == 4
    assert line(checks, "gyroscope of the board: off")["verdict"] == "fail"


def test_the_port_of_the_board_is_not_asked_for_a_lidar() -> None:
    code, checks = diagnose("--board", "sim://same/board", "--lidar", "sim://same/board")
    assert code == 4
    assert line(checks, "one port, two devices")["fix"] == (
        "[lidar] port sim://same/board is also that of [board]; give each device its own"
    )


def test_a_missing_port_is_a_failed_check() -> None:
    code, checks = diagnose("--board", "/dev/ttyNONE7", "--lidar", "/dev/ttyNONE8")
    assert code == 4
    assert "/dev/ttyNONE7" in line(checks, "board")["fix"]
    assert "/dev/ttyNONE8" in line(checks, "lidar")["fix"]


def test_a_wrong_baud_rate_is_named(tmp_path: Path) -> None:
    config = tmp_path / "robot.toml"
    config.write_text('[board]\nport = "sim://d9/board"\nbaud = 250000\n[lidar]\nport = "sim://d9/lidar"\n')
    code, checks = diagnose("--config", str(config))
    assert code == 4
    assert "at 250000 baud is not the Thumper protocol" in line(checks, "board")["fix"]


def test_a_busy_port_is_named() -> None:
    master, slave = os.openpty()
    try:
        with serial.Serial(os.ttyname(slave), exclusive=True) as port:
            code, checks = diagnose("--board", str(port.name))
    finally:
        os.close(master)
        os.close(slave)
    assert code == 4
    assert "another program has it open; close that program first" in line(checks, "board")["fix"]
