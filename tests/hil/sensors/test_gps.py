"""The GPS driver on the simulated receiver: positions, accuracy, outages, refusal, recording."""

import math
from pathlib import Path

import numpy as np
import pytest

from tests.variants import some_of
from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2
from thumper.common.serial_port import open_port
from thumper.config.robot import RobotConfig, with_ports
from thumper.doctor.sensor_checks import check_sensors
from thumper.gps.driver import GpsDriver
from thumper.gps.fix import Fix, FixStatus
from thumper.gps.local_plane import LatLon, LocalPlane
from thumper.gps.nmea import SentenceDecoder, fix_of_gga
from thumper.gps.open_gps import open_gps
from thumper.gps.options import GpsOptions
from thumper.recording.reader import Recording
from thumper.recording.start_stop import recording_control
from thumper.ros import from_ros
from thumper.runtime.assembly import open_robot
from thumper_hil.bench import simulation
from thumper_hil.faults.switches import Switches
from thumper_hil.sensors.gnss_receiver import DATUM, KINDS, GnssReceiver

HERE_M = np.array([3.0, -2.0])


def receiver(kind: str, rate_Hz: float = 1.0, seed: int = 1, wall_m: float = 100.0) -> GnssReceiver:
    return GnssReceiver(
        pose_at=lambda times_s: np.tile((*HERE_M, 0.0), (times_s.size, 1)),
        wall_m=lambda _x, _y: wall_m,
        faults=Switches(chip=None),  # type: ignore[arg-type]  # it has none
        kind=kind,
        rate_Hz=rate_Hz,
        seed=seed,
    )


def fixes(device: GnssReceiver, until_s: float) -> list[Fix]:
    device.advance(until_s + 1.0)
    messages = SentenceDecoder().feed(device.read())
    return [fix_of_gga(message, 0.0) for message in messages if message.msgID == "GGA"]


def errors_m(found: list[Fix]) -> np.ndarray:
    plane = LocalPlane(DATUM)
    places = [plane.to_plane(LatLon(fix.latitude_deg, fix.longitude_deg)) for fix in found]
    return np.asarray(np.array(places) - HERE_M)


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "circle_m"), some_of([("autonomous", 1.5), ("sbas", 1.0), ("rtk", 0.01)]))
def test_half_of_the_positions_are_in_the_circle_of_the_data_sheet(kind: str, circle_m: float) -> None:
    found = [fixes(receiver(kind, seed=seed), 30.0)[-1] for seed in range(200)]
    share = np.mean(np.linalg.norm(errors_m(found), axis=1) < circle_m)
    assert 0.4 < share < 0.6  # 200 receivers: three standard deviations are 0.11


def test_its_error_is_correlated_and_grows_near_walls() -> None:
    steps_m = np.diff(errors_m(fixes(receiver("sbas"), 300.0)[5:]), axis=0)
    assert np.std(steps_m) < 0.9 * KINDS["sbas"].std_m  # independent errors: 1.4 times
    far, near = (
        np.std([errors_m(fixes(receiver("rtk", seed=seed, wall_m=wall_m), 15.0)[-1:]) for seed in range(60)])
        for wall_m in (100.0, 0.1)
    )
    assert near > 1.7 * far


def config(name: str, options: str = "", **gps: float) -> RobotConfig:
    robot = RobotConfig(gps=GpsOptions(enabled=True, **gps))  # type: ignore[arg-type]
    mission = f"world=lab&x_m=1.73&y_m=0.08&yaw_deg=180{options}"
    return with_ports(robot, board=f"sim://{name}/board?{mission}", lidar=f"sim://{name}/lidar")


def test_ubx_is_recognized_and_has_the_same_fixes() -> None:
    with open_robot(config("gps-ubx", "&gps=rtk&gps_Hz=5&gps_protocol=ubx"), Pose2()) as robot:
        found: list[Fix] = []
        while simulation("gps-ubx").time_s < 14.0:
            robot.step()
            found += robot.inputs.feeds[0].samples
    assert [fix.status for fix in found[:5]] == 5 * [FixStatus.NONE]  # acquiring
    rtk = [fix for fix in found if fix.std_m < 0.05]
    assert len(rtk) > 10
    for fix in rtk:
        assert fix.status is FixStatus.RTK
        assert fix.std_m == pytest.approx(KINDS["rtk"].std_m, abs=1e-4)  # of NAV-COV, or of NAV-PVT
        at = LocalPlane(DATUM).to_plane(LatLon(fix.latitude_deg, fix.longitude_deg))
        assert math.dist(at, (1.73, 0.08)) < 0.2
    assert np.abs(np.diff([fix.time_s for fix in rtk]) - 0.2).max() < 0.01


def test_its_fixes_are_recorded_and_its_outages_survived(tmp_path: Path) -> None:
    scenario = tmp_path / "outage.toml"
    scenario.write_text(
        'faults = [{ at_s = 14.0, gps.sky = "blocked" }, { at_s = 17.0, gps.sky = "ok" },'
        '{ at_s = 22.0, gps = "unplugged" }, { at_s = 24.0, gps = "ok" }]'
    )
    settings = config("gps-recorded", f"&gps=rtk&gps_Hz=5&scenario={scenario}")
    with (
        open_robot(settings, Pose2()) as robot,
        recording_control(robot, settings, Pose2(), tmp_path, print) as control,
    ):
        bench = simulation("gps-recorded")
        control.start()
        while bench.time_s < 32.0:
            robot.step()
            robot.inputs.reopen_sensors()
        assert robot.inputs.feeds[0].sensor.counters.restarts == 1
        recorder = control.close()
    assert recorder is not None
    recorded = list(Recording((recorder.files[0],)).messages())
    (static,) = (each.decode() for each in recorded if each.topic == "tf_static")
    messages = [each.decode() for each in recorded if each.topic == "gps"]
    assert {message.header.frame_id for message in messages} == {static.transforms[1].child_frame_id}
    found = [from_ros.fix_of(message) for message in messages]
    rtk = [fix for fix in found if fix.status is FixStatus.RTK and fix.std_m < 0.05]
    assert min(fix.time_s for fix in rtk) == pytest.approx(10.0, abs=1.0)
    blocked = [fix.time_s for fix in found if fix.status is FixStatus.NONE and fix.time_s > 5.0]
    assert 14.0 < min(blocked) < max(blocked) < 19.5
    plane = LocalPlane(DATUM)
    for fix in rtk:
        at = plane.to_plane(LatLon(fix.latitude_deg, fix.longitude_deg))
        assert math.dist(at, (1.73, 0.08)) < 0.2
    epochs_s = np.array([fix.time_s for fix in found if 5.0 < fix.time_s < 21.5])
    assert np.abs(np.diff(epochs_s) - 0.2).max() < 0.01  # evenly stamped, however it is read
    lateness_s = np.remainder(epochs_s + 0.1, 0.2) - 0.1
    assert np.abs(lateness_s).max() < 0.1


def test_the_doctor_reports_fix_and_accuracy() -> None:
    (check,) = check_sensors(config("gps-doctor"), seconds=4.0)
    assert (check.verdict, check.fix) == ("pass", "")
    assert check.what == "gps: 1.0 Hz, SBAS fix, 0.85 m, 0 damaged"


def test_the_doctor_says_what_to_do_without_a_fix() -> None:
    (check,) = check_sensors(config("gps-new"), seconds=0.5)
    assert check.verdict == "warn"
    assert "no fix" in check.what
    assert "open sky" in check.fix


def test_a_wrong_baud_rate_is_refused() -> None:
    with pytest.raises(
        ThumperError, match="sends neither NMEA nor UBX-NAV-PVT at 9600 baud; correct"
    ) as refusal:
        open_gps(config("gps-baud", baud=9600).gps)
    assert refusal.value.exit_code == 3
    assert "\n" not in str(refusal.value)


def test_a_silent_port_is_refused() -> None:
    with pytest.raises(ThumperError, match=r"no data from the GPS receiver on .*; check its cable"):
        GpsDriver(open_port("loop://", baud=38_400, name="gps"), latency_s=0.1)
