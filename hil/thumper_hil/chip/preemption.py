"""Force an interrupt at every instruction of the main loop, each in a forked copy of the simulated chip."""

import ctypes
import re
import subprocess
from collections.abc import Set
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path

from thumper.board.framing import encode_frame
from thumper.board.messages import BoardModel, Identify
from thumper_hil.chip.chip import CPU_HZ, ChipError
from thumper_hil.chip.chip_faults import FaultyChip
from thumper_hil.chip.instrumented_chip import FLASH_BYTES
from thumper_hil.chip.wiring import ENCODERS

TICKS, MEMORY, BYTES = 4, 48, 320
CAPACITY = 20_000


class Interrupt(IntEnum):
    """The interrupts that a sweep can force (ATmega328P data sheet, table 11-6)."""

    RIGHT_EDGE = 3
    LEFT_EDGE = 5
    TICK = 11
    MILLISECOND = 14
    TONE_PULSE = 15
    RECEIVE = 18
    SEND = 19
    ANALOGUE = 21
    I2C = 24


class _Watched(ctypes.Structure):
    """`WatchedMemory` of preemption.hpp."""

    _fields_ = tuple((name, ctypes.c_uint16) for name in ("at_entry", "entry_size", "at_exit", "exit_size"))


class _Branch(ctypes.Structure):
    """`Branch` of preemption.hpp."""

    _fields_ = (
        ("cycle", ctypes.c_uint64),
        ("address", ctypes.c_uint32),
        ("crashed", ctypes.c_uint32),
        ("ticks", ctypes.c_uint32),
        ("entry", (ctypes.c_uint8 * MEMORY) * TICKS),
        ("exit", (ctypes.c_uint8 * MEMORY) * TICKS),
        ("shortest_rest", ctypes.c_uint64 * 2),
        ("longest_pulse", ctypes.c_uint64 * 2),
        ("byte_count", ctypes.c_uint32),
        ("bytes", ctypes.c_uint8 * BYTES),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Branch:
    """What followed an interrupt that was forced after the instruction at `address`."""

    address: int
    cycle: int
    crashed: bool
    entries: tuple[bytes, ...]  # the watched memory at the start of each control tick
    exits: tuple[bytes, ...]  # and at its end
    shortest_rest_s: tuple[float, float]  # left, right: from a change of direction to a driven pin
    longest_pulse_s: tuple[float, float]  # left, right: PWM pin high while the timer does not drive it
    received: bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class Symbol:
    """A variable of the firmware: its address in the data space, and its size [bytes]."""

    address: int
    size: int


def symbol(elf: Path, name: str) -> Symbol:
    """Return a variable of main.cpp's unnamed namespace; raise ChipError if there is no such variable."""
    text = subprocess.run(["avr-nm", "-S", elf], capture_output=True, text=True, check=True).stdout
    found = re.search(rf"^(\w+) (\w+) [bBdD] _ZN12_GLOBAL__N_1{len(name)}{name}E", text, re.MULTILINE)
    if found is None:
        raise ChipError(f"{elf}: has no variable {name!r}")
    return Symbol(address=int(found[1], 16) & 0xFFFF, size=int(found[2], 16))


class SweptChip(FaultyChip):
    """A T'REX whose interrupts can be forced at every instruction."""

    def sweep(
        self,
        interrupt: Interrupt,
        *,
        seconds: float,
        tail_s: float,
        watch: tuple[Symbol, Symbol],
        stride: int = 1,
        per_address: int = 0,
        skip: Set[int] = frozenset(),
    ) -> list[Branch]:
        """Force an interrupt after every `stride`-th instruction of the main loop in the next `seconds`.

        Each branch runs for `tail_s` more. `watch`: memory to record at the start and at the end of each
        control tick. For an edge, channel A of that encoder changes; for RECEIVE, an `identify` begins to
        arrive. SEND, ANALOGUE and I2C end early what their device is doing; instructions where it does
        nothing are left out, as is TONE_PULSE without a tone. `per_address` above 0: only so often at each
        address of the program, and not at all at those in `skip`, for long windows; each branch then
        records only what follows it and the frame that is arriving, and its first tick is the last one
        before it.

        Raises
        ------
        ChipError
            The system has no more processes.
        """
        left, right = ENCODERS[BoardModel.TREX]
        pins = right if interrupt is Interrupt.RIGHT_EDGE else left
        at_entry, at_exit = watch
        watched = _Watched(at_entry.address, at_entry.size, at_exit.address, at_exit.size)
        frame = encode_frame(Identify.ID, 99, Identify().pack())
        branches = (_Branch * CAPACITY)()
        count = self._library.thumper_sweep(
            self._handle,
            ctypes.byref(watched),
            self.cycle + round(seconds * CPU_HZ),
            interrupt,
            pins.port.encode(),
            pins.a_bit,
            frame,
            len(frame),
            round(tail_s * CPU_HZ),
            stride,
            per_address,
            bytes(address in skip for address in range(FLASH_BYTES)),
            branches,
            CAPACITY,
        )
        if count < 0:
            raise ChipError("the sweep needs more processes than the system allows")
        if count == CAPACITY:
            raise ChipError(f"the sweep has more than {CAPACITY} branches: choose a larger stride")
        return [_branch(raw, at_entry.size, at_exit.size) for raw in branches[:count]]


def _branch(raw: _Branch, entry_size: int, exit_size: int) -> Branch:
    ticks = min(raw.ticks, TICKS)
    rest = [cycles / CPU_HZ for cycles in raw.shortest_rest]
    pulse = [cycles / CPU_HZ for cycles in raw.longest_pulse]
    return Branch(
        address=raw.address,
        cycle=raw.cycle,
        crashed=bool(raw.crashed),
        entries=tuple(bytes(raw.entry[i])[:entry_size] for i in range(ticks)),
        exits=tuple(bytes(raw.exit[i])[:exit_size] for i in range(ticks)),
        shortest_rest_s=(rest[0], rest[1]),
        longest_pulse_s=(pulse[0], pulse[1]),
        received=bytes(raw.bytes)[: raw.byte_count],
    )
