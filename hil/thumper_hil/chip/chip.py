"""A simulated ATmega328P that runs a firmware ELF, with motors, wheels, battery and body round it."""

import ctypes
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path

from thumper.board.messages import Board as BoardKind
from thumper.common.errors import EXIT_CHECK_FAILED, ThumperError
from thumper.common.geometry import Pose2
from thumper_hil.chip.native_library import LIBRARY, CTruth, load_library
from thumper_hil.chip.robot_params import RobotParams

CPU_HZ = 16_000_000
ELF_HEADER_BYTES = 20
EM_AVR = 83
"""The ELF format's number for AVR."""


class ChipError(ThumperError):
    """The simulated chip cannot start (something is not built or installed), or its firmware has crashed."""

    def __init__(self, message: str) -> None:
        super().__init__(message, exit_code=EXIT_CHECK_FAILED)


class RunStatus(IntEnum):
    """Why `run` came back (thumper::RunStatus)."""

    TIME_REACHED = 0
    BYTES_READY = 1
    CRASHED = 2
    ASLEEP_FOR_EVER = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class Truth:
    """What really happens, at one cycle. Pairs are left, right; forward is positive."""

    time_s: float
    map_from_base: Pose2
    wheel_rad: tuple[float, float]
    wheel_rad_s: tuple[float, float]
    current_A: tuple[float, float]
    encoder_count: tuple[int, int]
    battery_V: float
    charge: float  # 0...1


class Chip:
    """The chip, from power-on. Without `params` it is bare: nothing is wired to its pins;
    otherwise the robot is, as `board` says.

    Raises
    ------
    ChipError
        The library or the ELF is missing or unusable; the message says what to run.
    """

    def __init__(
        self,
        elf: Path,
        *,
        params: RobotParams | None = None,
        board: BoardKind = BoardKind.TREX,
        seed: int = 0,
    ) -> None:
        self._handle: int | None = None
        _check_elf(elf)
        try:
            self._library = load_library()
        except OSError as error:
            cure = "install libsimavr2 and libelf1" if LIBRARY.exists() else "run `make chip`"
            raise ChipError(f"{LIBRARY}: cannot load the simulated chip; {cure}") from error
        numbers = params.flat() if params else []
        array = (ctypes.c_double * len(numbers))(*numbers) if numbers else None
        message = ctypes.create_string_buffer(256)
        self._handle = self._library.thumper_open(
            str(elf).encode(), array, len(numbers), board, seed, message, len(message)
        )
        if self._handle is None:
            raise ChipError(f"{elf}: {message.value.decode()}; run `make firmware chip`")
        self._elf = elf

    def close(self) -> None:
        """Free the chip; nothing else may be called afterwards. Calling it twice is fine."""
        if self._handle is not None:
            self._library.thumper_close(self._handle)
            self._handle = None

    def __del__(self) -> None:
        self.close()

    @property
    def cycle(self) -> int:
        """Clock cycles since power-on."""
        return int(self._library.thumper_cycle(self._handle))

    @property
    def time_s(self) -> float:
        """Simulated seconds since power-on."""
        return self.cycle / CPU_HZ

    @property
    def resets(self) -> int:
        """How often the chip was reset since power-on."""
        return int(self._library.thumper_resets(self._handle))

    @property
    def awake_share(self) -> float:
        """The processor's load since power-on: the share of the cycles that it did not sleep, 0...1."""
        return 1.0 - int(self._library.thumper_slept_cycles(self._handle)) / max(self.cycle, 1)

    @property
    def overruns(self) -> int:
        """Bytes lost because the firmware did not fetch them in time."""
        return int(self._library.thumper_overruns(self._handle))

    @property
    def available(self) -> int:
        """Bytes from the chip that have fully arrived by now."""
        return int(self._library.thumper_available(self._handle))

    def run(self, until_cycle: int, *, bytes_wanted: int = 0) -> bool:
        """Run until a clock cycle, or until so many bytes wait for the host; returns whether they do.

        Raises
        ------
        ChipError
            The firmware has crashed or will never wake up again.
        """
        status = self._library.thumper_run(self._handle, until_cycle, bytes_wanted)
        if status == RunStatus.CRASHED:
            address = self._library.thumper_program_counter(self._handle)
            raise ChipError(
                f"{self._elf}: the firmware crashed at {self.time_s:.6f} s: no instruction at 0x{address:04x}"
            )
        if status == RunStatus.ASLEEP_FOR_EVER:
            raise ChipError(f"{self._elf}: asleep with interrupts off for ever, at {self.time_s:.6f} s")
        return bool(status == RunStatus.BYTES_READY)

    def reset(self) -> None:
        """Pull the reset pin."""
        self._library.thumper_reset(self._handle)

    def data(self, address: int) -> int:
        """Return a byte of the data space: registers, I/O, SRAM."""
        return int(self._library.thumper_data(self._handle, address))

    def set_host_baud(self, baud: int) -> None:
        """Set the host's rate: at another one than the chip's, both sides see garbage. 0 is always right."""
        self._library.thumper_set_host_baud(self._handle, baud)

    def send(self, data: bytes) -> None:
        """Queue bytes to the chip; they go out one after another at line rate."""
        self._library.thumper_send(self._handle, data, len(data))

    def receive(self, limit: int) -> bytes:
        """Fetch up to `limit` bytes that have arrived."""
        return self.receive_stamped(limit)[0]

    def receive_stamped(self, limit: int) -> tuple[bytes, list[int]]:
        """Fetch up to `limit` bytes, and the cycle at which each one's stop bit ended."""
        data = ctypes.create_string_buffer(limit)
        cycles = (ctypes.c_uint64 * limit)()
        count = self._library.thumper_receive(self._handle, data, cycles, limit)
        return data.raw[:count], cycles[:count]

    def truth(self) -> Truth:
        """Return the truth now; only with `params`."""
        raw = CTruth()
        self._library.thumper_truth(self._handle, ctypes.byref(raw))
        return Truth(
            time_s=raw.time_s,
            map_from_base=Pose2(x_m=raw.x_m, y_m=raw.y_m, theta_rad=raw.yaw_rad),
            wheel_rad=(raw.wheel_rad[0], raw.wheel_rad[1]),
            wheel_rad_s=(raw.wheel_rad_s[0], raw.wheel_rad_s[1]),
            current_A=(raw.current_A[0], raw.current_A[1]),
            encoder_count=(int(raw.encoder_count[0]), int(raw.encoder_count[1])),
            battery_V=raw.battery_V,
            charge=raw.charge,
        )

    def place(self, map_from_base: Pose2) -> None:
        """Put the robot somewhere else; its wheels do not notice."""
        self._library.thumper_place(
            self._handle, map_from_base.x_m, map_from_base.y_m, map_from_base.theta_rad
        )

    def hold(self, v_m_s: float, w_rad_s: float) -> None:
        """Let an obstacle hold the body against motion in this direction, until `release`."""
        self._library.thumper_hold(self._handle, v_m_s, w_rad_s)

    def release(self) -> None:
        """Take the obstacle away."""
        self._library.thumper_release(self._handle)


def _check_elf(elf: Path) -> None:
    try:
        header = elf.open("rb").read(ELF_HEADER_BYTES)
    except OSError as error:
        raise ChipError(f"{elf}: cannot read the firmware; run `make firmware`") from error
    machine = int.from_bytes(header[18:20], "little")
    if header[:4] != b"\x7fELF" or machine != EM_AVR:
        raise ChipError(f"{elf}: no firmware for an AVR; run `make firmware`")
