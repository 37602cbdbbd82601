"""Faults that the firmware detects: wheels that do not follow, noisy encoders, currents, a restart."""

import ctypes
from collections.abc import Callable

import pytest

from tests.firmware.core.host_interface import HostInterface
from thumper.board import messages as m

FINE, STALL, REVERSED = range(3)


class Ticks:
    """An armed robot with synthetic control ticks."""

    def __init__(self, core: ctypes.CDLL) -> None:
        self.core, self.host = core, HostInterface(core)
        self.left = self.right = self.lost = 0
        self.host.command(m.Command.ARM)

    def step(
        self, left: int = 0, right: int = 0, left_pwm: int = 0, right_pwm: int = 0, lost: int = 0
    ) -> m.Fault:
        """Move by these counts and apply the PWM from now on; return the fault."""
        self.left, self.right, self.lost = self.left + left, self.right + right, self.lost + lost
        self.host.send(m.SetWheelSpeeds(left=0, right=0))
        self.core.host_watch(self.host.handle, self.left, self.right, left_pwm, right_pwm, self.lost)
        return self.host.status()[1]


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(("side", "stall"), [("left", m.Fault.STALL_LEFT), ("right", m.Fault.STALL_RIGHT)])
def test_no_motion_at_half_pwm_is_a_stall_after_300_ms(
    core: ctypes.CDLL, side: str, stall: m.Fault, sign: int
) -> None:
    ticks = Ticks(core)
    pwm = {f"{side}_pwm": 128 * sign}
    faults = [ticks.step(**pwm) for _ in range(4)]
    assert faults == [m.Fault.NONE] * 3 + [stall]
    assert ticks.host.status() == (m.State.FAULT, stall, 0, 0)


@pytest.mark.parametrize(
    ("pwm", "ticks_to_fault"), [(255, 3), (128, 3), (127, 3), (126, 4), (95, 4), (94, 5), (60, 7), (33, 12)]
)
@pytest.mark.parametrize("mode", [m.State.CLOSED_LOOP, m.State.MANUAL])
def test_less_pwm_takes_longer_to_report_a_stall(
    core: ctypes.CDLL, pwm: int, ticks_to_fault: int, mode: m.State
) -> None:
    """At 38 PWM s and after at least 300 ms, in either mode, so the distance of a runaway is bounded."""
    host = HostInterface(core)
    host.command(m.Command.ARM)
    command: m.Message = m.SetWheelSpeeds(left=300, right=300)
    if mode is m.State.MANUAL:
        command = m.SetMotorPwm(left=pwm, right=-pwm)
    ticks = 0
    while host.status()[1] is m.Fault.NONE:
        host.send(command)
        assert host.status()[0] is mode
        core.host_watch(host.handle, 0, 0, pwm, -pwm, 0)
        ticks += 1
    assert ticks == ticks_to_fault + 1, "the first tick starts the PWM"
    assert host.status()[:2] == (m.State.FAULT, m.Fault.STALL_LEFT)


def test_no_stall_at_the_idle_pwm(core: ctypes.CDLL) -> None:
    ticks = Ticks(core)
    for _ in range(100):
        assert ticks.step(left_pwm=32, right_pwm=-32) is m.Fault.NONE
    for _ in range(11):
        assert ticks.step(left_pwm=33) is m.Fault.NONE
    for _ in range(12):
        assert ticks.step(left_pwm=32) is m.Fault.NONE, "which restarts the integral"
    for _ in range(12):
        assert ticks.step(left_pwm=33) is m.Fault.NONE
    assert ticks.step(left_pwm=33) is m.Fault.STALL_LEFT


def test_the_pwm_integral_restarts_from_zero(core: ctypes.CDLL) -> None:
    """126, 126 and 127 are one short of 38 PWM s."""
    monitor = core.wheel_monitor_new()
    for _ in range(3):
        pwms = [126, 126, 127, 126, 0]
        verdicts = [core.wheel_monitor_step(monitor, 0, pwm) for pwm in pwms]
        assert verdicts == [FINE] * 4 + [STALL]


@pytest.mark.parametrize("sign", [1, -1])
def test_backwards_then_stationary_is_a_stall_not_swapped_wires(core: ctypes.CDLL, sign: int) -> None:
    monitor = core.wheel_monitor_new()
    counts = [0, -3, -3, -3, -3, -3, -3]
    verdicts = [core.wheel_monitor_step(monitor, count * sign % 65536, 200 * sign) for count in counts]
    assert verdicts == [FINE] * 6 + [STALL]


@pytest.mark.parametrize("sign", [1, -1])
def test_less_pwm_takes_longer_to_report_swapped_wires(core: ctypes.CDLL, sign: int) -> None:
    monitor = core.wheel_monitor_new()
    verdicts = [core.wheel_monitor_step(monitor, -2 * tick * sign % 65536, 60 * sign) for tick in range(8)]
    assert verdicts == [FINE] * 7 + [REVERSED]


def test_swapped_wires_are_reported_after_more_counts_than_fit(
    core_at_rate: Callable[[int], ctypes.CDLL],
) -> None:
    """Its progress has 8 bits: at 100 Hz and little PWM a wheel counts 285 backwards before the decision."""
    core = core_at_rate(100)
    monitor = core.wheel_monitor_new()
    verdicts = [core.wheel_monitor_step(monitor, -3 * tick % 65536, 40) for tick in range(96)]
    assert verdicts == [FINE] * 95 + [REVERSED]


def test_a_wheel_that_turns_round_makes_progress(core: ctypes.CDLL) -> None:
    """No matter how far it went in the wrong direction."""
    monitor = core.wheel_monitor_new()
    counts = [0, -500, -1000, -997, -994, -991, -988, -985, -982]
    assert {core.wheel_monitor_step(monitor, count % 65536, 200) for count in counts} == {FINE}


@pytest.mark.parametrize("sign", [1, -1])
def test_two_counts_in_300_ms_are_a_stall_and_three_are_not(core: ctypes.CDLL, sign: int) -> None:
    ticks = Ticks(core)
    ticks.step(left_pwm=200 * sign)
    for _ in range(10):
        for counts in (1, 1, 1):
            assert ticks.step(left=counts * sign, left_pwm=200 * sign) is m.Fault.NONE
    assert ticks.step(left=sign, left_pwm=200 * sign) is m.Fault.NONE
    assert ticks.step(left=sign, left_pwm=200 * sign) is m.Fault.NONE
    assert ticks.step(left=0, left_pwm=200 * sign) is m.Fault.STALL_LEFT


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(
    ("side", "reversed_"), [("left", m.Fault.REVERSED_LEFT), ("right", m.Fault.REVERSED_RIGHT)]
)
def test_a_wheel_that_keeps_counting_the_wrong_way_is_reversed(
    core: ctypes.CDLL, side: str, reversed_: m.Fault, sign: int
) -> None:
    ticks = Ticks(core)
    ticks.step(**{f"{side}_pwm": 200 * sign})
    move = {side: -100 * sign, f"{side}_pwm": 200 * sign}
    assert [ticks.step(**move) for _ in range(3)] == [m.Fault.NONE, m.Fault.NONE, reversed_]


@pytest.mark.parametrize("tau_s", [0.05, 0.075, 0.15, 0.3])
@pytest.mark.parametrize("sign", [1, -1])
def test_a_full_reversal_is_no_fault(core: ctypes.CDLL, tau_s: float, sign: int) -> None:
    """From +17 to -17 rad/s with full PWM against the motion, for fast and slow wheels."""
    monitor = core.wheel_monitor_new()
    speed, angle = 17.0 * sign, 0.0
    core.wheel_monitor_step(monitor, 0, -255 * sign)
    for _ in range(12):
        for _ in range(100):
            speed += (-17.0 * sign - speed) * 0.001 / tau_s
            angle += speed * 0.001
        count = round(angle * 1200 / 6.2832)
        assert core.wheel_monitor_step(monitor, count % 65536, -255 * sign) == FINE


def test_alternating_pwm_restarts_the_integral(core: ctypes.CDLL) -> None:
    monitor = core.wheel_monitor_new()
    for tick in range(40):
        assert core.wheel_monitor_step(monitor, 0, 200 if tick % 4 < 2 else -200) == FINE


def test_huge_count_jumps_are_handled(core: ctypes.CDLL) -> None:
    monitor = core.wheel_monitor_new()
    core.wheel_monitor_step(monitor, 0, -255)
    verdicts = [core.wheel_monitor_step(monitor, 32768 * (tick % 2), -255) for tick in range(1, 7)]
    assert set(verdicts) <= {FINE, STALL, REVERSED}
    driven = core.wheel_monitor_new()
    core.wheel_monitor_step(driven, 0, 255)
    verdicts = [core.wheel_monitor_step(driven, -30_000 * tick % 65536, 255) for tick in range(1, 4)]
    assert verdicts == [FINE, FINE, REVERSED]


@pytest.mark.parametrize("rate_Hz", [10, 100])
@pytest.mark.parametrize("phase", range(40))
def test_a_steady_rate_of_lost_edges_is_detected_at_every_phase(
    core_at_rate: Callable[[int], ctypes.CDLL], rate_Hz: int, phase: int
) -> None:
    """30 in 300 ms are never a fault. 31 in 300 ms are detected within another 100 ms."""
    core = core_at_rate(rate_Hz)
    window = 3 * rate_Hz // 10

    def first_noise(per_window: int) -> int | None:
        monitor = core.edge_monitor_new()
        for _ in range(phase):
            assert core.edge_monitor_step(monitor, 0) == 0
        for tick in range(1, 20 * window):
            if core.edge_monitor_step(monitor, tick * per_window // window):
                return tick
        return None

    assert first_noise(30) is None
    noticed = first_noise(31)
    assert noticed is not None
    assert window <= noticed <= window + rate_Hz // 10


def test_lost_edges_at_the_start_are_noise_for_300_ms(core_at_rate: Callable[[int], ctypes.CDLL]) -> None:
    core = core_at_rate(100)
    monitor = core.edge_monitor_new()
    assert [core.edge_monitor_step(monitor, 31) for _ in range(31)] == [1] * 30 + [0]


@pytest.mark.parametrize("phase", range(6))
@pytest.mark.parametrize("burst", [(31, 0, 0), (0, 0, 31), (15, 1, 15), (1, 29, 1)])
def test_31_lost_edges_in_300_ms_are_noise_and_30_are_not(
    core: ctypes.CDLL, burst: tuple[int, int, int], phase: int
) -> None:
    for spared in (0, 1):
        monitor = core.edge_monitor_new()
        total, noisy = -spared, 0
        for lost in [0] * phase + list(burst) + [0] * 6:
            total += lost
            noisy |= core.edge_monitor_step(monitor, max(total, 0))
        assert noisy == (spared == 0)


def test_lost_edges_stop_the_motors(core: ctypes.CDLL) -> None:
    ticks = Ticks(core)
    assert ticks.step(lost=30) is m.Fault.NONE
    assert ticks.step(lost=1) is m.Fault.LOST_EDGES
    assert ticks.host.telemetry().lost_edges == 31


def test_the_lost_edge_count_may_wrap(core: ctypes.CDLL) -> None:
    monitor = core.edge_monitor_new()
    for lost in (65_530, 65_530, 65_530):
        core.edge_monitor_step(monitor, lost)
    assert core.edge_monitor_step(monitor, 10) == 0
    assert core.edge_monitor_step(monitor, 30) == 1


@pytest.mark.parametrize(("left", "right"), [(8_001, 0), (-8_001, 0), (0, 8_001), (0, -8_001)])
def test_three_consecutive_readings_above_the_limit_are_over_current(
    core: ctypes.CDLL, left: int, right: int
) -> None:
    host = HostInterface(core)
    host.command(m.Command.ARM)
    for currents in [(left, right)] * 2 + [(8_000, -8_000)] + [(left, right)] * 2:
        core.host_currents(host.handle, *currents)
        assert host.status()[1] is m.Fault.NONE
    core.host_currents(host.handle, left, right)
    assert host.status()[:2] == (m.State.FAULT, m.Fault.OVER_CURRENT)
    telemetry = host.telemetry()
    assert (telemetry.left_current_mA, telemetry.right_current_mA) == (left, right)


def test_the_current_limit_is_a_parameter(core: ctypes.CDLL) -> None:
    host = HostInterface(core)
    host.set("current_limit", 5000)
    host.command(m.Command.ARM)
    for _ in range(3):
        core.host_currents(host.handle, 5001, 0)
    assert host.status()[1] is m.Fault.OVER_CURRENT


def test_after_a_watchdog_restart_the_fault_must_be_cleared(core: ctypes.CDLL) -> None:
    host = HostInterface(core, cause=m.ResetCause.WATCHDOG)
    assert host.status() == (m.State.FAULT, m.Fault.WATCHDOG, 0, 0)
    assert host.command(m.Command.ARM) is m.AckStatus.FAULT_LATCHED
    assert host.command(m.Command.CLEAR_FAULT) is m.AckStatus.OK
    assert host.command(m.Command.ARM) is m.AckStatus.OK


def test_telemetry_reports_all_values(core: ctypes.CDLL) -> None:
    host = HostInterface(core, battery_mV=0)
    assert host.telemetry().warnings == 0, "no reading yet: no warning"
    core.host_battery(host.handle, 6900)
    core.host_watch(host.handle, 70_000, -5, 100, -100, 3)
    host.feed(b"\x05rubbish\0")
    telemetry = host.telemetry()
    assert (telemetry.left_count, telemetry.right_count) == (70_000, -5)
    assert (telemetry.left_pwm, telemetry.right_pwm) == (100, -100)
    assert (telemetry.time_us, telemetry.battery_mV, telemetry.warnings) == (100_000, 6900, 1)
    assert (telemetry.lost_edges, telemetry.rx_frames, telemetry.rx_errors) == (3, 0, 1)
    host.send(m.Identify())
    assert host.telemetry().rx_frames == 1
    core.host_battery(host.handle, 9000)
    assert host.telemetry().warnings == 0
    assert (telemetry.state, telemetry.fault) == (m.State.DISARMED, m.Fault.NONE)
    assert (telemetry.heading, telemetry.gyroscope) == (0x1234, m.GyroscopeState.READY)
    host.command(m.Command.E_STOP)
    stopped = host.telemetry()
    assert (stopped.state, stopped.fault) == (m.State.FAULT, m.Fault.E_STOP)


def test_manual_stops_at_the_link_timeout(core: ctypes.CDLL) -> None:
    host = HostInterface(core)
    host.command(m.Command.ARM)
    host.send(m.SetWheelSpeeds(left=5000, right=5000))
    host.send(m.SetMotorPwm(left=300, right=-300))
    assert host.status() == (m.State.MANUAL, m.Fault.NONE, 255, -255)
    host.wait(300)
    assert host.status() == (m.State.FAULT, m.Fault.LINK_LOST, 0, 0)


def test_arming_again_changes_nothing_and_keeps_no_link_alive(core: ctypes.CDLL) -> None:
    host = HostInterface(core)
    host.command(m.Command.ARM)
    host.send(m.SetWheelSpeeds(left=1000, right=1000))
    host.wait(200)
    host.command(m.Command.ARM)
    assert host.status() == (m.State.CLOSED_LOOP, m.Fault.NONE, 1000, 1000)
    host.wait(100)
    assert host.status()[:2] == (m.State.FAULT, m.Fault.LINK_LOST)


def test_silence_before_a_disarm_does_not_count_after_it(core: ctypes.CDLL) -> None:
    host = HostInterface(core)
    host.command(m.Command.ARM)
    host.wait(250)
    host.command(m.Command.DISARM)
    host.command(m.Command.ARM)
    host.wait(299)
    assert host.status()[0] is m.State.CLOSED_LOOP


def test_wheel_speeds_are_limited_to_17_rad_s(core: ctypes.CDLL) -> None:
    host = HostInterface(core)
    host.command(m.Command.ARM)
    host.send(m.SetWheelSpeeds(left=32767, right=-32768))
    assert host.status() == (m.State.CLOSED_LOOP, m.Fault.NONE, 17_000, -17_000)


@pytest.mark.parametrize("sides", [(1, 0), (-1, 0), (0, 1), (0, -1)])
def test_a_current_at_the_limit_is_no_fault_and_above_it_is(
    core: ctypes.CDLL, sides: tuple[int, int]
) -> None:
    at, above = core.current_monitor_new(), core.current_monitor_new()
    for _ in range(3):
        at_limit = core.current_monitor_step(at, sides[0] * 5000, sides[1] * 5000, 5000)
        over = core.current_monitor_step(above, sides[0] * 5001, sides[1] * 5001, 5000)
    assert (at_limit, over) == (0, 1)
    assert [core.current_monitor_step(above, *sides, 0) for _ in range(5)] == [1] * 5, "while it lasts"


def test_without_analogue_readings_the_motors_stop_and_nothing_old_is_reported(core: ctypes.CDLL) -> None:
    host = HostInterface(core)
    host.command(m.Command.ARM)
    core.host_currents(host.handle, 1000, 2000)
    core.host_lose_analog(host.handle)
    assert host.status() == (m.State.FAULT, m.Fault.ADC_STOPPED, 0, 0)
    telemetry = host.telemetry()
    assert (telemetry.battery_mV, telemetry.left_current_mA, telemetry.right_current_mA) == (0, 0, 0)
    assert host.command(m.Command.CLEAR_FAULT) is m.AckStatus.BATTERY_UNKNOWN
    core.host_battery(host.handle, 7400)
    assert host.command(m.Command.CLEAR_FAULT) is m.AckStatus.OK


def test_a_battery_that_reads_too_high_stops_the_motors(core: ctypes.CDLL) -> None:
    host = HostInterface(core)
    host.command(m.Command.ARM)
    while host.status()[1] is m.Fault.NONE:
        assert core.host_battery(host.handle, 14_100) == 0, "not low"
    assert host.status()[:2] == (m.State.FAULT, m.Fault.HIGH_BATTERY)
    assert host.command(m.Command.CLEAR_FAULT) is m.AckStatus.BATTERY_HIGH


@pytest.mark.parametrize("cells", range(1, 8))
def test_too_high_a_voltage_is_noticed_with_any_pack(core: ctypes.CDLL, cells: int) -> None:
    """Also with seven cells, whose 31.5 V the divider cannot read. A full pack is no fault."""
    full_scale_mV = core.battery_from_sum(1023 * 32)
    host = HostInterface(core, battery_mV=0)
    host.set("battery_cells", cells)
    core.host_battery(host.handle, 4200 * cells)
    assert host.command(m.Command.ARM) is m.AckStatus.OK
    for _ in range(100):
        core.host_battery(host.handle, min(full_scale_mV, 4520 * cells))
    assert host.status()[:2] == (m.State.FAULT, m.Fault.HIGH_BATTERY)


@pytest.mark.parametrize("cells", range(1, 8))
def test_the_highest_voltage_of_a_pack_is_no_fault(core: ctypes.CDLL, cells: int) -> None:
    limit_mV = min(4500 * cells, 30_000)
    for reading_mV, fault in ((limit_mV, m.Fault.NONE), (limit_mV + 1, m.Fault.HIGH_BATTERY)):
        host = HostInterface(core, battery_mV=0)
        host.set("battery_cells", cells)
        core.host_battery(host.handle, reading_mV)
        assert host.status()[1] is fault


def test_ticks_without_telemetry_are_counted(core: ctypes.CDLL) -> None:
    host = HostInterface(core)
    for dropped, total in ((0, 0), (3, 3), (200, 203), (255, 458)):
        core.host_dropped(host.handle, dropped)
        assert host.telemetry().tx_dropped == total


@pytest.mark.parametrize(("setpoint", "fault"), [(300, m.Fault.NONE), (-300, m.Fault.REVERSED_LEFT)])
def test_a_wheel_that_is_carried_on_while_the_controller_brakes_is_no_wiring_fault(
    core: ctypes.CDLL, setpoint: int, fault: m.Fault
) -> None:
    """In a turn on a rough floor the body drags a wheel forward, as commanded, against a negative output."""
    ticks = Ticks(core)
    core.host_setpoints(ticks.host.handle, setpoint, 0)
    faults = {ticks.step(left=3, left_pwm=-100) for _ in range(30)}
    assert faults == {m.Fault.NONE, fault}


def test_a_reversed_encoder_is_found_at_a_set_point_of_zero(core: ctypes.CDLL) -> None:
    ticks = Ticks(core)
    assert m.Fault.REVERSED_LEFT in {ticks.step(left=-3, left_pwm=100) for _ in range(30)}


@pytest.mark.parametrize(("speed", "fault"), [(2299, m.Fault.NONE), (2300, m.Fault.REVERSED_LEFT)])
@pytest.mark.parametrize("sign", [1, -1])
def test_a_reversed_encoder_is_not_taken_for_braking(
    core: ctypes.CDLL, speed: int, fault: m.Fault, sign: int
) -> None:
    """Its controller accelerates the wheel, so the speed is 2 rad/s or more away from the set-point."""
    ticks = Ticks(core)
    core.host_setpoints(ticks.host.handle, 300 * sign, 0)
    core.host_speeds(ticks.host.handle, speed * sign, 0)
    faults = {ticks.step(left=30 * sign, left_pwm=-200 * sign) for _ in range(30)}
    assert faults == {m.Fault.NONE, fault}


def test_a_set_point_with_the_number_of_the_pwm_is_no_braking(core: ctypes.CDLL) -> None:
    ticks = Ticks(core)
    core.host_setpoints(ticks.host.handle, 100, 0)
    assert {ticks.step(left_pwm=100) for _ in range(30)} == {m.Fault.NONE, m.Fault.STALL_LEFT}


STALL_A = 15.0
HELD_mA = round(0.75 * 1000 * STALL_A * 100 / 255)
"""Current of a held wheel at PWM 100, at the limit."""


@pytest.mark.parametrize(
    ("left", "right", "current_mA", "stall_A", "fault"),
    [
        (-200, 1000, -HELD_mA - 60, STALL_A, m.Fault.NONE),
        (-200, 1000, HELD_mA + 60, STALL_A, m.Fault.NONE),  # some boards' sensors have the other sign
        (-200, 1000, -HELD_mA + 60, STALL_A, m.Fault.STALL_LEFT),  # it turns, but it does not count
        (-200, 1000, -500, 1.7, m.Fault.NONE),  # 75 % of 1.7 A at PWM 100
        (-200, 1000, -499, 1.7, m.Fault.STALL_LEFT),
        (-200, 1000, -HELD_mA - 60, 0.0, m.Fault.STALL_LEFT),  # no current sensor
        (-200, 1000, 0, 0.0, m.Fault.STALL_LEFT),
        (200, 1000, HELD_mA + 60, STALL_A, m.Fault.STALL_LEFT),  # no counter-turn
        (-200, -1000, -HELD_mA - 60, STALL_A, m.Fault.STALL_LEFT),
        (-200, 400, -HELD_mA - 60, STALL_A, m.Fault.STALL_LEFT),  # on the spot
        (-200, 401, -HELD_mA - 60, STALL_A, m.Fault.NONE),
        (-700, 2000, -HELD_mA - 60, STALL_A, m.Fault.NONE),
        (-701, 2000, -HELD_mA - 60, STALL_A, m.Fault.STALL_LEFT),  # not slow
    ],
)
@pytest.mark.parametrize("side", ["left", "right"])
def test_a_wheel_held_by_the_floor_in_a_counter_turn_is_no_stall(
    core: ctypes.CDLL, left: int, right: int, current_mA: int, stall_A: float, fault: m.Fault, side: str
) -> None:
    """The integral still grows, and the motor's current shows that the wheel does not turn."""
    ticks = Ticks(core)
    ticks.host.command(m.Command.DISARM)
    assert ticks.host.set("stall_current", round(500 * stall_A)) is m.AckStatus.OK
    ticks.host.command(m.Command.ARM)
    pwm = 100 if left > 0 else -100
    first = side == "left"
    core.host_setpoints(ticks.host.handle, *((left, right) if first else (right, left)))
    core.host_currents(ticks.host.handle, *((current_mA, 0) if first else (0, current_mA)))
    expected = fault if first or fault is m.Fault.NONE else m.Fault.STALL_RIGHT
    assert {ticks.step(**{f"{side}_pwm": pwm}) for _ in range(30)} == {m.Fault.NONE, expected}
