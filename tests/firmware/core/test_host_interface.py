"""Answers and actions of the firmware, message by message, driven with the generated Python codec."""

import ctypes
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.firmware.core.host_interface import HostInterface, frame, read_frames
from thumper.board import messages as m

DOCUMENT = Path(__file__).resolve().parents[3] / "docs" / "explanation" / "firmware.md"


@pytest.fixture
def host(core: ctypes.CDLL) -> HostInterface:
    return HostInterface(core)


def test_identity_carries_the_schema_hash(host: HostInterface) -> None:
    (identity,) = host.send(m.Identify(), seq=77)
    assert isinstance(identity, m.Identity)
    assert identity.schema_hash == m.SCHEMA_HASH
    assert (identity.control_rate_Hz, identity.counts_per_rev) == (10, 1200)
    assert (identity.wheel_radius_mm, identity.track_mm) == (62, 245)
    assert identity.reset_cause is m.ResetCause.POWER_ON
    version = f"{identity.version_major}.{identity.version_minor}.{identity.version_patch}"
    assert f"of version {version}, on a DAGU" in DOCUMENT.read_text(encoding="utf-8")


def test_set_points_apply_only_in_closed_loop(host: HostInterface) -> None:
    speeds = m.SetWheelSpeeds(left=1234, right=-4321)
    assert host.send(speeds) == []
    assert host.status() == (m.State.DISARMED, m.Fault.NONE, 0, 0)
    assert host.command(m.Command.ARM) is m.AckStatus.OK
    assert host.status() == (m.State.CLOSED_LOOP, m.Fault.NONE, 0, 0)
    host.send(speeds)
    assert host.status() == (m.State.CLOSED_LOOP, m.Fault.NONE, 1234, -4321)
    host.command(m.Command.DISARM)
    assert host.status() == (m.State.DISARMED, m.Fault.NONE, 0, 0)


def test_manual_overrides_closed_loop_and_arm_returns_with_zero_set_points(host: HostInterface) -> None:
    host.send(m.SetMotorPwm(left=50, right=50))
    assert host.status()[0] is m.State.DISARMED, "manual needs an armed robot"
    host.command(m.Command.ARM)
    host.send(m.SetWheelSpeeds(left=5000, right=5000))
    host.send(m.SetMotorPwm(left=-50, right=60))
    assert host.status() == (m.State.MANUAL, m.Fault.NONE, -50, 60)
    host.send(m.SetWheelSpeeds(left=5000, right=5000))
    assert host.status() == (m.State.MANUAL, m.Fault.NONE, -50, 60)
    host.command(m.Command.ARM)
    assert host.status() == (m.State.CLOSED_LOOP, m.Fault.NONE, 0, 0)


def test_silence_stops_the_motors_after_300_ms(host: HostInterface) -> None:
    host.command(m.Command.ARM)
    for _ in range(5):
        host.send(m.SetWheelSpeeds(left=1000, right=1000))
        host.wait(299)
        assert host.status()[0] is m.State.CLOSED_LOOP
    host.wait(1)
    assert host.status() == (m.State.FAULT, m.Fault.LINK_LOST, 0, 0)
    assert host.command(m.Command.ARM) is m.AckStatus.FAULT_LATCHED
    assert host.command(m.Command.CLEAR_FAULT) is m.AckStatus.OK
    assert host.command(m.Command.ARM) is m.AckStatus.OK


@pytest.mark.parametrize("last", [m.SetWheelSpeeds(left=1, right=1), m.SetMotorPwm(left=1, right=1), None])
def test_link_timeout_starts_at_the_state_change_or_last_command(
    host: HostInterface, last: m.Message | None
) -> None:
    host.command(m.Command.ARM)
    if last:
        host.wait(200)
        host.send(last)
    host.wait(299)
    assert host.status()[1] is m.Fault.NONE
    host.wait(1)
    assert host.status()[1] is m.Fault.LINK_LOST


def test_wheel_speeds_do_not_keep_motor_pwm_alive(host: HostInterface) -> None:
    host.command(m.Command.ARM)
    host.send(m.SetMotorPwm(left=100, right=100))
    for _ in range(3):
        host.wait(100)
        host.send(m.SetWheelSpeeds(left=1000, right=1000))
        host.send(m.GetParameter(index=0))
    assert host.status() == (m.State.FAULT, m.Fault.LINK_LOST, 0, 0)


def test_e_stop_latches_even_while_disarmed(host: HostInterface) -> None:
    host.command(m.Command.E_STOP)
    assert host.status() == (m.State.FAULT, m.Fault.E_STOP, 0, 0)
    host.send(m.SetMotorPwm(left=100, right=100))
    assert host.status() == (m.State.FAULT, m.Fault.E_STOP, 0, 0)


@pytest.mark.parametrize(
    ("battery_mV", "status"), [(0, m.AckStatus.BATTERY_UNKNOWN), (6900, m.AckStatus.BATTERY_LOW)]
)
def test_arming_needs_a_charged_battery(core: ctypes.CDLL, battery_mV: int, status: m.AckStatus) -> None:
    host = HostInterface(core, battery_mV=battery_mV)
    assert host.command(m.Command.ARM) is status
    assert host.command(m.Command.CLEAR_FAULT) is status
    assert host.status()[:2] == (m.State.DISARMED, m.Fault.NONE)
    assert host.command(m.Command.E_STOP) is m.AckStatus.OK
    for _ in range(200):
        core.host_battery(host.handle, 7200)
    assert host.command(m.Command.CLEAR_FAULT) is m.AckStatus.OK
    assert host.command(m.Command.ARM) is m.AckStatus.OK


@pytest.mark.parametrize("cause", [m.ResetCause.EXTERNAL, m.ResetCause.WATCHDOG])
@pytest.mark.parametrize("latched", [m.Fault.E_STOP, m.Fault.LOW_BATTERY, m.Fault.STALL_LEFT])
def test_a_latched_fault_survives_a_restart(core: ctypes.CDLL, latched: m.Fault, cause: m.ResetCause) -> None:
    host = HostInterface(core, cause=cause, latched=latched)
    assert host.status() == (m.State.FAULT, latched, 0, 0)
    assert host.command(m.Command.ARM) is m.AckStatus.FAULT_LATCHED
    assert host.command(m.Command.CLEAR_FAULT) is m.AckStatus.OK
    assert host.command(m.Command.ARM) is m.AckStatus.OK


def test_link_lost_is_not_latched_again_after_a_restart(core: ctypes.CDLL) -> None:
    host = HostInterface(core, cause=m.ResetCause.EXTERNAL, latched=m.Fault.LINK_LOST)
    assert host.status()[:2] == (m.State.DISARMED, m.Fault.NONE)


def test_a_low_battery_does_not_hide_an_emergency_stop(core: ctypes.CDLL, host: HostInterface) -> None:
    host.command(m.Command.E_STOP)
    assert core.host_battery(host.handle, 3000) == 0, "filtered"
    while not core.host_battery(host.handle, 3000):
        pass
    assert host.status()[1] is m.Fault.E_STOP
    assert host.telemetry().warnings == 1
    assert host.command(m.Command.CLEAR_FAULT) is m.AckStatus.BATTERY_LOW


def test_low_battery_stops_and_holds_until_charged(core: ctypes.CDLL, host: HostInterface) -> None:
    host.command(m.Command.ARM)
    host.send(m.SetWheelSpeeds(left=1000, right=1000))
    while not core.host_battery(host.handle, 6300):
        assert host.status()[0] is m.State.CLOSED_LOOP
    assert host.status() == (m.State.FAULT, m.Fault.LOW_BATTERY, 0, 0)
    assert host.command(m.Command.CLEAR_FAULT) is m.AckStatus.BATTERY_LOW
    for _ in range(200):
        assert core.host_battery(host.handle, 7200) == 0
    assert host.status()[0] is m.State.FAULT, "only a command re-arms"
    assert host.command(m.Command.CLEAR_FAULT) is m.AckStatus.OK
    assert host.command(m.Command.ARM) is m.AckStatus.OK
    assert sum(core.host_battery(host.handle, 6300) for _ in range(200)) == 1, "empty again"
    assert host.status()[:2] == (m.State.FAULT, m.Fault.LOW_BATTERY)


def test_a_stop_voltage_above_the_one_for_arming_still_stops(core: ctypes.CDLL) -> None:
    host = HostInterface(core, battery_mV=8000)
    host.set("battery_stop", 3700)
    host.set("battery_rearm", 3500)
    assert host.command(m.Command.ARM) is m.AckStatus.OK
    assert sum(core.host_battery(host.handle, 7200) for _ in range(200)) == 1
    assert host.status()[:2] == (m.State.FAULT, m.Fault.LOW_BATTERY)
    assert host.command(m.Command.CLEAR_FAULT) is m.AckStatus.BATTERY_LOW


@pytest.mark.parametrize("spec", m.PARAMETERS, ids=lambda spec: spec.name)
def test_parameters_start_at_their_default_and_keep_their_range(
    host: HostInterface, spec: m.ParameterSpec
) -> None:
    def get() -> int:
        (answer,) = host.send(m.GetParameter(index=spec.index))
        assert isinstance(answer, m.ParameterValue)
        assert answer.index == spec.index
        return answer.value

    def set_(value: int) -> m.AckStatus:
        (answer,) = host.send(m.SetParameter(index=spec.index, value=value))
        assert isinstance(answer, m.Ack)
        return answer.status

    low, high = round(spec.minimum * spec.scale), round(spec.maximum * spec.scale)
    assert get() == round(spec.default * spec.scale)
    for value in (low, high):
        assert set_(value) is m.AckStatus.OK
        assert get() == value
    for value in (low - 1, high + 1, 2**15 - 1, -(2**15)):
        assert set_(value) is m.AckStatus.OUT_OF_RANGE
        assert get() == high


def test_unknown_parameters_and_commands_are_refused(host: HostInterface) -> None:
    index = len(m.PARAMETERS)
    for request in (
        m.GetParameter(index=index),
        m.SetParameter(index=index, value=0),
        m.SetParameter(index=255, value=0),
    ):
        (answer,) = host.send(request)
        assert isinstance(answer, m.Ack)
        assert (answer.request_id, answer.status) == (request.ID, m.AckStatus.UNKNOWN_PARAMETER)
    ((_, answer),) = host.feed(frame(m.CommandRequest.ID, b"\x07"))
    assert isinstance(answer, m.Ack)
    assert answer.status is m.AckStatus.UNKNOWN_COMMAND


def test_wrong_ids_and_lengths_are_counted_and_ignored(core: ctypes.CDLL, host: HostInterface) -> None:
    host.command(m.Command.ARM)
    requests = [message for id_, message in m.MESSAGES.items() if 0x01 < id_ < 0x80]
    bad = [frame(0x7F, b""), frame(m.Telemetry.ID, b""), *(frame(r.ID, b"\1\1") for r in requests)]
    assert host.feed(b"".join(bad)) == []
    assert core.host_rx_errors(host.handle) == len(bad)
    assert host.status() == (m.State.CLOSED_LOOP, m.Fault.NONE, 0, 0)


def test_every_known_request_counts_as_a_valid_frame(core: ctypes.CDLL, host: HostInterface) -> None:
    """Answered or not, accepted or refused: a valid frame proves that the host is present."""
    requests: list[m.Message] = [
        m.Identify(),
        m.SetWheelSpeeds(left=0, right=0),
        m.SetMotorPwm(left=0, right=0),
        *(m.CommandRequest(command=command) for command in m.Command),
        m.SetParameter(index=0, value=1),
        m.SetParameter(index=99, value=1),
        m.GetParameter(index=0),
        m.GetParameter(index=99),
    ]
    for number, request in enumerate(requests, start=1):
        host.send(request)
        assert core.host_handled(host.handle) == number
    assert core.host_rx_errors(host.handle) == 0
    host.feed(b"\x01\x02\0")
    assert core.host_handled(host.handle) == len(requests)


@settings(max_examples=150, deadline=None)
@given(
    noise=st.lists(
        st.one_of(
            st.binary(max_size=20),
            st.builds(frame, st.integers(0, 255), st.binary(max_size=6)),
        ),
        max_size=12,
    )
)
def test_no_byte_stream_moves_a_silent_robot(core: ctypes.CDLL, noise: list[bytes]) -> None:
    """After any input and 300 ms of silence, the motors are off and `identify` is answered."""
    host = HostInterface(core)
    host.feed(b"".join(noise) + b"\0")
    host.wait(300)
    state, _, left, right = host.status()
    assert state in (m.State.DISARMED, m.State.FAULT)
    assert (left, right) == (0, 0)
    assert isinstance(host.send(m.Identify())[0], m.Identity)


def test_telemetry_sequence_starts_at_zero_and_wraps(core: ctypes.CDLL, host: HostInterface) -> None:
    """And across the wrap, so that the host detects every missing frame."""
    out = ctypes.create_string_buffer(100)
    numbers = []
    for _ in range(300):
        size = core.host_telemetry(host.handle, out)
        numbers += [number for number, _ in read_frames(out.raw[:size])]
    assert numbers == [number % 256 for number in range(300)]


def test_current_is_zero_before_the_first_reading(host: HostInterface) -> None:
    telemetry = host.telemetry()
    assert (telemetry.left_current_mA, telemetry.right_current_mA) == (0, 0)


@pytest.mark.parametrize(("left", "right"), [(0, 0), (5, 0), (0, -5), (5, 5)])
def test_quiet_requires_both_wheels_stationary(host: HostInterface, left: int, right: int) -> None:
    host.core.host_speeds(host.handle, left, right)
    assert host.core.host_quiet(host.handle) == int(left == right == 0)


def test_not_quiet_while_armed(host: HostInterface) -> None:
    host.command(m.Command.ARM)
    assert host.core.host_quiet(host.handle) == 0


def test_derived_constants_use_live_parameters_and_battery_voltage(core: ctypes.CDLL) -> None:
    host = HostInterface(core, battery_mV=8000)
    host.set("kp", 1234)
    initial = [round(spec.default * spec.scale) for spec in m.PARAMETERS]
    values = (ctypes.c_int32 * 8)(1234, *initial[1:8])
    due, given = (ctypes.c_int32 * 9)(), (ctypes.c_int32 * 9)()
    core.derive(values, 8000, due)
    core.host_derive(host.handle, given)
    assert list(given) == list(due)


def test_only_host_messages_have_a_payload_size(core: ctypes.CDLL) -> None:
    sent = (
        m.Identify(),
        m.SetWheelSpeeds(left=0, right=0),
        m.SetMotorPwm(left=0, right=0),
        m.CommandRequest(command=m.Command.ARM),
        m.SetParameter(index=0, value=0),
        m.GetParameter(index=0),
    )
    lengths = {message.ID: len(message.pack()) for message in sent}
    assert [core.host_payload_size(id_) for id_ in range(256)] == [
        lengths.get(id_, 0xFF) for id_ in range(256)
    ]
