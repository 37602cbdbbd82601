"""Who drives by hand, and for how long."""

from thumper.common.geometry import Twist2
from thumper.runtime.drive.twist_mux import ManualCommand, TwistMux
from thumper.runtime.requests import TeleopSource, Velocity

SLOW, FAST = Twist2(v_m_s=0.1), Twist2(v_m_s=0.5)


def mux_with(*commands: tuple[float, TeleopSource, Twist2]) -> TwistMux:
    mux = TwistMux(gamepad_timeout_s=0.3, teleop_timeout_s=0.4)
    for at_s, channel, twist in commands:
        mux.add(at_s, Velocity(channel=channel, twist=twist))
    return mux


def test_nobody_drives_at_first() -> None:
    assert mux_with().active(0.0) is None


def test_the_gamepad_goes_before_the_page() -> None:
    mux = mux_with((0.0, TeleopSource.GAMEPAD, FAST), (0.1, TeleopSource.TELEOP, SLOW))
    assert mux.active(0.2) == ManualCommand(source=TeleopSource.GAMEPAD, twist=FAST)


def test_each_command_holds_only_for_a_moment() -> None:
    mux = mux_with((0.0, TeleopSource.GAMEPAD, FAST), (0.0, TeleopSource.TELEOP, SLOW))
    assert mux.active(0.31) == ManualCommand(source=TeleopSource.TELEOP, twist=SLOW)
    assert mux.active(0.41) is None


def test_zero_lets_go_at_once() -> None:
    mux = mux_with((0.0, TeleopSource.GAMEPAD, FAST), (0.1, TeleopSource.GAMEPAD, Twist2()))
    assert mux.active(0.1) is None


def test_a_channel_that_stands_still_does_not_take_over() -> None:
    mux = mux_with((0.0, TeleopSource.TELEOP, SLOW), (0.1, TeleopSource.GAMEPAD, Twist2()))
    assert mux.active(0.2) == ManualCommand(source=TeleopSource.TELEOP, twist=SLOW)
