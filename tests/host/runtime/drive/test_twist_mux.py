"""Priority and expiry of manual commands."""

from thumper.common.geometry import Twist2
from thumper.runtime.drive.twist_mux import COMMAND_TIMEOUT_S, ManualCommand, TwistMux
from thumper.runtime.requests import TeleopSource, Velocity

SLOW, FAST = Twist2(v_m_s=0.1), Twist2(v_m_s=0.5)


def mux_with(*commands: tuple[float, TeleopSource, Twist2]) -> TwistMux:
    mux = TwistMux(gamepad_timeout_s=0.3, teleop_timeout_s=0.4)
    for at_s, channel, twist in commands:
        mux.add(at_s, Velocity(channel=channel, twist=twist))
    return mux


def test_no_command_at_first() -> None:
    assert mux_with().active(0.0) is None


def test_the_gamepad_has_priority() -> None:
    mux = mux_with((0.0, TeleopSource.GAMEPAD, FAST), (0.1, TeleopSource.TELEOP, SLOW))
    assert mux.active(0.2) == ManualCommand(source=TeleopSource.GAMEPAD, twist=FAST)


def test_commands_expire() -> None:
    mux = mux_with((0.0, TeleopSource.GAMEPAD, FAST), (0.0, TeleopSource.TELEOP, SLOW))
    assert mux.active(0.31) == ManualCommand(source=TeleopSource.TELEOP, twist=SLOW)
    assert mux.active(0.41) is None


def test_zero_releases_the_source_at_once() -> None:
    mux = mux_with((0.0, TeleopSource.GAMEPAD, FAST), (0.1, TeleopSource.GAMEPAD, Twist2()))
    assert mux.active(0.1) is None


def test_a_released_source_does_not_take_over() -> None:
    mux = mux_with((0.0, TeleopSource.TELEOP, SLOW), (0.1, TeleopSource.GAMEPAD, Twist2()))
    assert mux.active(0.2) == ManualCommand(source=TeleopSource.TELEOP, twist=SLOW)


def test_both_sources_expire_after_the_time_of_the_safety_case() -> None:
    for source in TeleopSource:
        mux = TwistMux()
        mux.add(100.0, Velocity(channel=source, twist=SLOW))
        assert mux.active(100.0 + COMMAND_TIMEOUT_S - 0.01) is not None
        assert mux.active(100.0 + COMMAND_TIMEOUT_S + 0.01) is None
    assert COMMAND_TIMEOUT_S == 0.3


def test_forgotten_commands_do_not_come_back() -> None:
    mux = mux_with((0.0, TeleopSource.GAMEPAD, FAST), (0.0, TeleopSource.TELEOP, SLOW))
    mux.clear()
    assert mux.active(0.1) is None
