"""CPU core and ADC behave like the real chip where simavr alone does not; crashes are reported."""

import subprocess
from dataclasses import replace
from pathlib import Path

import pytest

from tests.allocated import kept_bytes
from tests.hil.chip.conftest import BuildAvr
from tests.hil.chip.rig import run_for
from thumper_hil.chip import native_library
from thumper_hil.chip.chip import CPU_HZ, Chip, ChipError
from thumper_hil.chip.robot_params import RobotParams


def test_interrupt_response_takes_four_cycles(build_avr: BuildAvr) -> None:
    """Match at 100, flag one cycle later, response 4 (data sheet 7.7.1), jump 3, `lds` reads in cycle 2."""
    chip = Chip(build_avr("entry"))
    run_for(chip, 0.01)
    (read_at,) = chip.receive(10)
    assert 100 + 8 <= read_at <= 100 + 12


def test_adc_samples_at_conversion_start(build_avr: BuildAvr, even_params: RobotParams) -> None:
    """The ADC reads the battery although another channel is selected later; 1024 steps to the reference."""
    chip = Chip(build_avr("adc"), params=even_params)
    run_for(chip, 0.01)
    reply = chip.receive(6)
    battery, current, band_gap = (int.from_bytes(reply[i : i + 2], "little") for i in (0, 2, 4))
    assert battery == int(chip.truth().battery_V / even_params.board.battery_V_per_count)
    assert current == 511
    assert band_gap == int(1.1 / 5.0 * 1024)


def test_an_eeprom_write_takes_its_time(build_avr: BuildAvr) -> None:
    """EEPE stays set for 3.4 ms, and a byte written meanwhile is lost."""
    chip = Chip(build_avr("eeprom"))
    run_for(chip, 0.01)
    reply = chip.receive(6)
    took, first, second = (int.from_bytes(reply[i : i + 2], "little") for i in (0, 2, 4))
    assert took * 256 / CPU_HZ == pytest.approx(3.4e-3, abs=3e-5)
    assert (first, second) == (0x55, 0xFF)


def test_pending_interrupt_ends_sleep_at_once(build_avr: BuildAvr) -> None:
    """`sei; sleep` with a pending interrupt must not sleep until the next event."""
    chip = Chip(build_avr("doze"))
    run_for(chip, 0.5)
    rounds = chip.receive(1000)
    expected = 0.5 / 1.2e-3  # each round takes only its delay
    assert 0.95 * expected <= len(rounds) <= expected
    assert chip.cpu_load > 0.99


def test_watchdog_reset_keeps_the_state_of_the_robot(build_avr: BuildAvr, even_params: RobotParams) -> None:
    """simavr clears all timers and input levels on a reset; motors and serial line must continue."""
    chip = Chip(build_avr("dog"), params=even_params)
    run_for(chip, 0.2)
    before = chip.truth()
    run_for(chip, 0.4)
    after = chip.truth()
    data, cycles = chip.receive_stamped(100)
    assert data[:4] == b"P.W."
    assert chip.resets >= 1
    assert cycles[3] - cycles[2] <= 320 + 16  # still ten bits per byte
    assert after.wheel_rad[0] > before.wheel_rad[0] + 1.0
    assert after.encoder_count[0] == pytest.approx(after.wheel_rad[0] * 1200 / 6.2831853, abs=1.0)


def test_reset_pin_restarts_the_firmware(build_avr: BuildAvr) -> None:
    chip = Chip(build_avr("burst"))
    run_for(chip, 0.01)
    assert len(chip.receive(100)) == 64
    chip.reset()
    run_for(chip, 0.01)
    assert len(chip.receive(100)) == 64
    assert chip.resets == 1


@pytest.mark.parametrize(("name", "words"), [("crash", "crashed"), ("coma", "cannot wake up")])
def test_dead_firmware_is_reported(build_avr: BuildAvr, name: str, words: str) -> None:
    chip = Chip(build_avr(name))
    with pytest.raises(ChipError, match=words):
        run_for(chip, 1.0)


def test_run_ends_at_the_requested_cycle(build_avr: BuildAvr) -> None:
    """Asleep or busy, the clock stops within one instruction of the requested cycle."""
    for name in ("doze", "burst"):
        chip = Chip(build_avr(name))
        for cycle in (1, 1000, 123_457, CPU_HZ // 3):
            chip.run(cycle)
            assert cycle <= chip.cycle <= cycle + 10


def test_unusable_firmware_is_reported_in_one_line(tmp_path: Path) -> None:
    text = tmp_path / "text.elf"
    text.write_text("not a program")
    for path in (text, tmp_path / "missing.elf"):
        with pytest.raises(ChipError, match="make firmware") as caught:
            Chip(path)
        assert caught.value.exit_code == 4
        assert str(path) in str(caught.value)
        assert "\n" not in str(caught.value)


def test_damaged_firmware_is_reported_not_read_past_its_end(build_avr: BuildAvr, tmp_path: Path) -> None:
    """Cut off anywhere in headers and code, of another machine, or beyond the flash."""
    whole = build_avr("doze").read_bytes()
    program_header = int.from_bytes(whole[28:32], "little")
    physical_address, file_size = program_header + 12, program_header + 16
    damaged = [whole[:size] for size in (0, 4, 51, program_header + 31, program_header + 200)]
    for place, value in ((18, 62), (physical_address, 0x8000), (file_size, 0x7FFF_FFFF), (program_header, 0)):
        damaged.append(whole[:place] + value.to_bytes(4, "little") + whole[place + 4 :])
    for number, content in enumerate(damaged):
        path = tmp_path / f"{number}.elf"
        path.write_bytes(content)
        with pytest.raises(ChipError, match=r"not a (program|firmware) for an AVR|larger than the flash"):
            Chip(path)


def test_same_seed_gives_the_same_robot(build_avr: BuildAvr, even_params: RobotParams) -> None:
    """Robots differ by their seeds only."""
    rough = replace(even_params, motor=replace(even_params.motor, spread_ratio=0.05))
    ends = []
    for seed in (1, 1, 2):
        chip = Chip(build_avr("dog"), params=rough, seed=seed)
        run_for(chip, 0.3)
        ends.append(chip.truth())
    assert ends[0] == ends[1]
    assert ends[0] != ends[2]


def test_a_chip_built_from_older_sources_is_refused(
    build_avr: BuildAvr, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    old = tmp_path / "old.so"
    subprocess.run(["gcc", "-shared", "-x", "c", "-", "-o", old], input=b"", check=True)
    monkeypatch.setattr(native_library, "LIBRARY", old)
    monkeypatch.setattr("thumper_hil.chip.chip.load_library", native_library.load_library.__wrapped__)
    with pytest.raises(ChipError, match="built from older sources; run `make chip`"):
        Chip(build_avr("entry"))


def test_a_closed_chip_keeps_no_memory(build_avr: BuildAvr, even_params: RobotParams) -> None:
    """simavr itself keeps 7.7 kB of each chip."""

    def open_and_close() -> None:
        chip = Chip(build_avr("adc"), params=even_params)
        run_for(chip, 0.01)
        chip.close()

    assert kept_bytes(open_and_close, warm_up=5, repeats=50) < 500
