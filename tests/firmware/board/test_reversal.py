"""A motor reverses at PWM 0, never in the new direction with the old duty. Traced on the emulated chip."""

import subprocess
from pathlib import Path

import pytest

from tests.firmware.board.boot import BUILD, ELF, ROOT
from tests.firmware.board.wire import frames, run_for, send
from thumper.board.framing import encode_frame
from thumper.board.messages import Command, CommandRequest, Identify, SetMotorPwm, SetWheelSpeeds, Telemetry
from thumper_hil.chip.chip import CPU_HZ
from thumper_hil.chip.chip_faults import FaultyChip
from thumper_hil.chip.instrumented_chip import InstrumentedChip
from thumper_hil.chip.robot_params import RobotParams

PWM_PERIOD_S = 510 * 256 / CPU_HZ
TCCR2A, TCCR2B, OCR2A, OCR2B = 0xB0, 0xB1, 0xB3, 0xB4
PHASE_CORRECT, FORCE_A, FORCE_B = 0b01, 1 << 7, 1 << 6
PORTB, PORTD = 0x25, 0x2B
TIMSK0, OCIE0B = 0x6E, 1 << 2
DIRECTION_AND_PWM = 1 << 2 | 1 << 3  # of both ports
STEP_S = 20e-6
FIRMWARE = BUILD.parent if (BUILD.parent / "Makefile").exists() else ROOT / "firmware"

# Port and bit of the direction pin, bit of the PWM output in TCCR2A, compare register.
SIDES = {"left": (PORTD, 2, 5, OCR2B), "right": (PORTB, 2, 7, OCR2A)}


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize(("before", "after"), [(200, -150), (-200, 150), (200, -1)])
def test_a_turning_motor_rests_first(side: str, before: int, after: int) -> None:
    port, direction_bit, output_bit, compare = SIDES[side]
    chip = InstrumentedChip(ELF, params=RobotParams.load())
    run_for(chip, 0.2)
    send(chip, CommandRequest(command=Command.ARM))
    for _ in range(3):
        send(chip, SetMotorPwm(left=before, right=before))
        run_for(chip, 0.1)
    assert chip.data(compare) == abs(before)
    assert chip.data(port) >> direction_bit & 1 == (before > 0)

    send(
        chip,
        SetMotorPwm(left=after if side == "left" else before, right=after if side == "right" else before),
    )
    turned_s = None
    on_s = None
    for _ in range(round(0.15 / STEP_S)):
        run_for(chip, STEP_S)
        driven = chip.data(TCCR2A) >> output_bit & 1
        if turned_s is None and chip.data(port) >> direction_bit & 1 == (after > 0):
            turned_s = chip.time_s
        if turned_s is None:
            assert chip.data(compare) == abs(before) or not driven, "no new duty in the old direction"
        elif on_s is None and driven:
            on_s = chip.time_s
            assert chip.data(compare) == abs(after)
        other = OCR2A if side == "left" else OCR2B
        assert chip.data(other) == abs(before), "the other motor continues"
    assert turned_s is not None
    assert on_s is not None
    assert PWM_PERIOD_S <= on_s - turned_s <= 0.012, "the old duty must be over when the timer drives again"


@pytest.mark.parametrize(("side", "force"), [("left", FORCE_B), ("right", FORCE_A)])
def test_the_timer_drives_a_pin_again_from_low(side: str, force: int) -> None:
    """While a pin is disconnected, the timer keeps its level, which may be high; a forced match clears it."""
    chip = InstrumentedChip(ELF, params=RobotParams.load())
    output = 1 << SIDES[side][2]
    assert connected_after_a_forced_match(chip, output, force), "at the start"
    run_for(chip, 0.2)
    send(chip, CommandRequest(command=Command.ARM))
    for pwm in (200, -150):
        send(chip, SetMotorPwm(left=pwm, right=pwm))
        run_for(chip, 0.1 if pwm > 0 else 0.001)
    while chip.data(TCCR2A) & output:
        run_for(chip, STEP_S)
    run_for(chip, 0.009)
    assert connected_after_a_forced_match(chip, output, force)


def connected_after_a_forced_match(chip: InstrumentedChip, output: int, force: int) -> bool:
    """Run until PWM drives a pin; return whether a match was forced outside PWM, with the pin connected."""
    forced = False
    while chip.data(TCCR2A) & (output | PHASE_CORRECT) != output | PHASE_CORRECT:
        chip.run(chip.cycle + 1)
        is_connected = chip.data(TCCR2A) & (output | PHASE_CORRECT) == output
        forced |= is_connected and bool(chip.data(TCCR2B) & force)
    return forced


def test_a_late_main_loop_shortens_no_rest() -> None:
    """Answers to a busy host delay it. Milliseconds before the rest must not count towards the rest."""
    chip = InstrumentedChip(ELF, params=RobotParams.load())
    run_for(chip, 0.5)
    send(chip, CommandRequest(command=Command.ARM))
    requests = 7 * encode_frame(Identify.ID, 7, Identify().pack())
    rests_s, turned_s = [], None
    forward = chip.data(PORTD) >> 2 & 1
    for step in range(round(2.0 / STEP_S)):
        if step % 5000 == 0:
            pwm = 200 if step % 10_000 else -200
            send(chip, SetMotorPwm(left=pwm, right=pwm))
        elif step % 251 == 0:  # at any phase to the millisecond
            chip.send(requests)
        run_for(chip, STEP_S)
        if chip.data(PORTD) >> 2 & 1 != forward:
            forward, turned_s = 1 - forward, chip.time_s
        if turned_s is not None and chip.data(TCCR2A) >> 5 & 1:
            rests_s.append(chip.time_s - turned_s)
            turned_s = None
    assert len(rests_s) >= 15
    assert min(rests_s) >= PWM_PERIOD_S


@pytest.mark.parametrize("speed_rad_s", [-8.0, 4.0, 12.0])
def test_a_rolling_wheel_that_is_taken_over_neither_rolls_on_nor_swings_back(speed_rad_s: float) -> None:
    """As after a drive by motor PWM. With a model speed of zero, the wheel would swing back with 40 to 70 %
    of its speed. Up to 26 % remain if the first output is 0 by chance: then the motors coast. Without any
    tracking it would roll on up to three times as far."""
    chip = InstrumentedChip(ELF, params=RobotParams.load(), seed=1)
    run_for(chip, 0.5)
    speed, pwm = round(1000 * speed_rad_s), round(17.0 * speed_rad_s)
    send(chip, CommandRequest(command=Command.ARM))
    for _ in range(40):
        send(chip, SetWheelSpeeds(left=speed, right=speed))
        run_for(chip, 0.05)
    send(chip, SetMotorPwm(left=pwm, right=pwm))
    run_for(chip, 0.12)
    begun = chip.truth()
    send(chip, CommandRequest(command=Command.ARM))
    shares = []
    for _ in range(150):
        send(chip, SetWheelSpeeds(left=0, right=0))
        run_for(chip, 0.01)
        shares.append(chip.truth().wheel_rad_s[0] / begun.wheel_rad_s[0])
    assert min(shares) >= -0.3
    assert shares[-1] == 0.0
    distance_rad = abs(chip.truth().wheel_rad[0] - begun.wheel_rad[0])
    assert distance_rad <= speed_rad_s**2 / (2 * 16.0), "no farther than with the ramp of the brakes"


@pytest.mark.parametrize("driven", [-100, 100])
def test_at_zero_pwm_a_motor_keeps_its_direction(driven: int) -> None:
    """A wheel that dithers around zero does not switch its direction each time."""
    chip = InstrumentedChip(ELF, params=RobotParams.load())
    run_for(chip, 0.2)
    send(chip, CommandRequest(command=Command.ARM))
    for pwm in (driven, 0, driven, 0):
        send(chip, SetMotorPwm(left=pwm, right=pwm))
        run_for(chip, 0.15)
        send(chip, SetMotorPwm(left=pwm, right=pwm))
        run_for(chip, 0.05)
        for port, direction_bit, _, compare in SIDES.values():
            assert chip.data(port) >> direction_bit & 1 == (driven > 0)
            assert chip.data(compare) == abs(pwm)


@pytest.fixture(scope="module")
def fast_elf(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A build for 100 Hz, where a reversed motor rests for a whole tick."""
    folder = tmp_path_factory.mktemp("fast")
    subprocess.run(["make", "-s", "-C", str(FIRMWARE), "RATE=100", f"BUILD={folder}"], check=True)
    return folder / "thumper.elf"


def driven_share(chip: InstrumentedChip, side: str, seconds: float) -> float:
    """Return the share of time in which the timer drives the side's pin with a duty."""
    _, _, output_bit, compare = SIDES[side]
    driven = 0
    for _ in range(round(seconds / STEP_S)):
        run_for(chip, STEP_S)
        driven += bool(chip.data(TCCR2A) >> output_bit & 1 and chip.data(compare))
    return driven / round(seconds / STEP_S)


def test_telemetry_reports_no_pwm_of_a_motor_that_only_rests(fast_elf: Path) -> None:
    chip = InstrumentedChip(fast_elf, params=RobotParams.load())
    run_for(chip, 0.3)
    send(chip, CommandRequest(command=Command.ARM))
    run_for(chip, 0.02)
    frames(chip)
    share = 0.0
    for step in range(30):
        pwm = 120 if step % 2 else -120
        send(chip, SetMotorPwm(left=pwm, right=120))
        share += driven_share(chip, "left", 0.01) / 30
    reported = [Telemetry.unpack(f.payload) for f in frames(chip) if f.message_id == Telemetry.ID][3:]
    assert share < 0.1
    assert {sample.left_pwm for sample in reported} == {0}
    assert {sample.right_pwm for sample in reported} == {120}


def test_a_side_rests_by_itself(fast_elf: Path) -> None:
    """If one side's reversals restarted the other's rest, neither would drive here."""
    chip = InstrumentedChip(fast_elf, params=RobotParams.load())
    run_for(chip, 0.3)
    send(chip, CommandRequest(command=Command.ARM))
    shares = []
    for step in range(40):
        left, right = (step + 1) // 2 % 2, step // 2 % 2  # in turn, each every 20 ms
        send(chip, SetMotorPwm(left=120 if left else -120, right=120 if right else -120))
        shares.append(driven_share(chip, "left", 0.01))
    assert sum(shares) / len(shares) > 0.3


def test_a_rest_does_not_end_during_a_tone(fast_elf: Path) -> None:
    """The battery empties while a motor turns round each tick, at a PWM too small to move it."""
    chip = FaultyChip(fast_elf, params=RobotParams.load())
    run_for(chip, 0.3)
    send(chip, CommandRequest(command=Command.ARM))
    chip.set_battery(charge=0.0)
    tones = 0
    for step in range(round(3.0 / 0.0002)):
        if step % 50 == 0:
            pwm = 1 if step % 100 else -1
            send(chip, SetMotorPwm(left=pwm, right=-pwm))
        run_for(chip, 0.0002)
        sounding = bool(chip.data(TIMSK0) & OCIE0B)
        tones += sounding
        assert not (sounding and chip.data(TCCR2A) >> 4)
    assert tones > 1000


def test_no_pin_is_given_back_to_the_timer_during_a_tone() -> None:
    """A tone toggles the directions, so the old duty could kick a motor. It rests after the tone too.

    Both pins of both motors change in a tone: pulses of one direction would move the robot.
    """
    chip = FaultyChip(ELF, params=RobotParams.load())
    run_for(chip, 0.3)
    chip.set_battery(charge=0.0)
    tones, last_tone_s, back_s = 0, 0.0, []
    high, low = {PORTB: 0, PORTD: 0}, {PORTB: 0, PORTD: 0}
    for _ in range(round(5.0 / 0.0002)):
        run_for(chip, 0.0002)
        sounding, connected = bool(chip.data(TIMSK0) & OCIE0B), chip.data(TCCR2A) >> 4
        assert not (sounding and connected)
        if sounding:
            tones += 1
            last_tone_s = chip.time_s
            for port in high:
                high[port] |= chip.data(port)
                low[port] |= ~chip.data(port)
        elif connected and last_tone_s:
            back_s.append(chip.time_s - last_tone_s)
            last_tone_s = 0.0
    assert tones > 1000
    assert all(high[port] & low[port] & DIRECTION_AND_PWM == DIRECTION_AND_PWM for port in high)
    assert len(back_s) >= 4
    assert min(back_s) >= PWM_PERIOD_S
