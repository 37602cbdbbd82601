"""Each sensor of the robot has its simulated device, its table in the TOML and its plug."""

from thumper.config.robot import SENSOR_TABLES
from thumper.runtime.sensor_table import KINDS
from thumper_hil.bench.sensor_table import SENSORS
from thumper_hil.faults.catalogue import FAULTS
from thumper_hil.faults.switches import DEVICES


def test_robot_and_simulator_have_the_same_sensors() -> None:
    names = [kind.name for kind in KINDS]
    assert names == list(SENSORS) == list(SENSOR_TABLES)
    assert ["board", "lidar", *names] == list(DEVICES)
    assert set(DEVICES) <= FAULTS.keys()
