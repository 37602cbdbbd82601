"""The watchdog of the simulated chip: first its interrupt, then a reset if it is not served."""

from tests.firmware.board.boot import chip_with_program
from tests.hil.chip.conftest import BuildAvr
from tests.hil.chip.rig import run_for
from thumper_hil.chip.chip import CPU_HZ, Chip


def test_watchdog_resets_a_hang_with_interrupts_off(build_avr: BuildAvr) -> None:
    """128 ms to the interrupt, which is served; then twice 128 ms, because interrupts are off at first."""
    chip = Chip(build_avr("deadlock"))
    run_for(chip, 1.0)
    data, cycles = chip.receive_stamped(10)
    assert data == b"PIW"
    assert chip.resets == 1
    to_interrupt_s = (cycles[1] - cycles[0]) / CPU_HZ
    to_reset_s = (cycles[2] - cycles[1]) / CPU_HZ
    assert 0.9 * 0.131 < to_interrupt_s < 1.1 * 0.131  # 16 K cycles of 128 kHz are 128 ms
    assert 1.9 * 0.131 < to_reset_s < 2.1 * 0.131


def test_stock_boot_loader_loops_after_a_watchdog_reset(build_avr: BuildAvr) -> None:
    """The watchdog keeps running at 16 ms, and the boot loader neither stops nor feeds it."""
    chip = chip_with_program(build_avr("dog"))
    run_for(chip, 5.0)
    assert chip.receive(100)[:2] == b"P."  # the program runs once and never again
    assert b"W" not in chip.receive(100)
    assert chip.resets > 150
