"""`sim://` as the board is a simulated robot with its own lidar, for the commands as for `Robot`."""

import pytest

from thumper.common.errors import ThumperError
from thumper.config.robot import RobotConfig, with_ports


def test_short_form_brings_the_lidar_and_keeps_the_options() -> None:
    config = with_ports(RobotConfig(), board="sim://?world=hall&seed=3", lidar="")
    name = config.board.port.partition("/board")[0]
    assert config.board.port == f"{name}/board?world=hall&seed=3&lidar=urg04lx"
    assert config.lidar.port == f"{name}/lidar"
    assert config.camera.port == f"{name}/camera"
    other = with_ports(RobotConfig(), board="sim://", lidar="")
    assert other.board.port.partition("/board")[0] != name


def test_short_form_works_in_a_configuration() -> None:
    config = with_ports(RobotConfig(), board="sim://", lidar="")
    again = with_ports(config, board="", lidar="")
    assert again.board.port == config.board.port


def test_short_form_refuses_another_lidar() -> None:
    with pytest.raises(ThumperError, match=r"sim:// has its own lidar; leave out /dev/ttyACM0"):
        with_ports(RobotConfig(), board="sim://", lidar="/dev/ttyACM0")


def test_full_ports_stay_as_they_are() -> None:
    config = with_ports(RobotConfig(), board="sim://a/board?world=hall", lidar="sim://a/lidar")
    assert (config.board.port, config.lidar.port) == ("sim://a/board?world=hall", "sim://a/lidar")


def test_a_named_board_brings_its_lidar_as_the_other_sensors() -> None:
    config = with_ports(RobotConfig(), board="sim://a/board?world=hall", lidar="")
    assert (config.lidar.port, config.camera.port) == ("sim://a/lidar", "sim://a/camera")
    assert with_ports(RobotConfig(), board="/dev/ttyUSB3", lidar="").lidar.port == "/dev/ttyACM0"
