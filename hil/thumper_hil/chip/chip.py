"""Run a firmware ELF on an emulated ATmega328P, with simulated motors, wheels, battery and chassis."""

import ctypes
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path

from thumper.board.messages import BoardModel
from thumper.common.errors import EXIT_CHECK_FAILED, ThumperError
from thumper.common.geometry import Pose2
from thumper_hil.chip.native_library import LIBRARY, CTruth, load_library
from thumper_hil.chip.robot_params import RobotParams

CPU_HZ = 16_000_000
ELF_HEADER_BYTES = 20
EM_AVR = 83
"""Machine number of AVR in an ELF header."""


class ChipError(ThumperError):
    """The simulated chip cannot start (a part is not built or installed), or its firmware crashed."""

    def __init__(self, message: str) -> None:
        super().__init__(message, exit_code=EXIT_CHECK_FAILED)


class RunStatus(IntEnum):
    """The reason why `run` returned (thumper::RunStatus)."""

    TIME_REACHED = 0
    BYTES_READY = 1
    CRASHED = 2
    ASLEEP_FOR_EVER = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class Truth:
    """Ground truth at one clock cycle. Pairs are (left, right); forward is positive."""

    time_s: float
    map_from_base: Pose2
    wheel_rad: tuple[float, float]
    wheel_rad_s: tuple[float, float]
    current_A: tuple[float, float]
    encoder_count: tuple[int, int]
    battery_V: float
    charge: float  # 0...1


class Chip:
    """The chip, from power-on. Without `params` nothing is wired to its pins.

    With `params` the simulated robot is wired to the pins of `board`.

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
        board: BoardModel = BoardModel.TREX,
        seed: int = 0,
    ) -> None:
        self._handle: int | None = None
        _check_elf(elf)
        try:
            self._library = load_library()
        except OSError as error:
            fix = "install libsimavr2" if LIBRARY.exists() else "run `make chip`"
            raise ChipError(f"{LIBRARY}: cannot load the simulated chip; {fix}") from error
        except AttributeError as error:
            raise ChipError(
                f"{LIBRARY}: the simulated chip was built from older sources; run `make chip`"
            ) from error
        numbers = params.flat() if params else []
        array = (ctypes.c_double * len(numbers))(*numbers) if numbers else None
        message = ctypes.create_string_buffer(256)
        self._handle = self._library.thumper_open(
            str(elf).encode(), array, len(numbers), board, seed, message, len(message)
        )
        if self._handle is None:
            raise ChipError(f"{elf}: {message.value.decode()}; run `make firmware chip`")
        self._elf = elf
        self.clock_Hz = CPU_HZ * (1.0 + (params.board.clock_drift if params else 0.0))

    @property
    def elf(self) -> Path:
        """The program that it runs."""
        return self._elf

    def close(self) -> None:
        """Free the chip. Call no other method afterwards; a second `close` does nothing."""
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
        return self.cycle / self.clock_Hz

    @property
    def resets(self) -> int:
        """Number of resets since power-on."""
        return int(self._library.thumper_resets(self._handle))

    @property
    def cpu_load(self) -> float:
        """Processor load since power-on: the share of cycles in which it did not sleep, 0...1."""
        return 1.0 - int(self._library.thumper_slept_cycles(self._handle)) / max(self.cycle, 1)

    @property
    def overruns(self) -> int:
        """Number of bytes lost because the firmware did not read them in time."""
        return int(self._library.thumper_overruns(self._handle))

    @property
    def available(self) -> int:
        """Number of bytes from the chip that have fully arrived."""
        return int(self._library.thumper_available(self._handle))

    def run(self, until_cycle: int, *, bytes_wanted: int = 0) -> bool:
        """Run until a clock cycle or until `bytes_wanted` bytes wait; return True if they do.

        Raises
        ------
        ChipError
            The firmware crashed, or sleeps and can never wake up.
        """
        status = self._library.thumper_run(self._handle, until_cycle, bytes_wanted)
        if status == RunStatus.CRASHED:
            address = self._library.thumper_program_counter(self._handle)
            raise ChipError(
                f"{self._elf}: the firmware crashed at {self.time_s:.6f} s: no instruction at 0x{address:04x}"
            )
        if status == RunStatus.ASLEEP_FOR_EVER:
            raise ChipError(
                f"{self._elf}: the firmware sleeps with interrupts disabled and cannot wake up, "
                f"at {self.time_s:.6f} s"
            )
        return bool(status == RunStatus.BYTES_READY)

    def reset(self) -> None:
        """Pull the reset pin."""
        self._library.thumper_reset(self._handle)

    def data(self, address: int) -> int:
        """Return one byte of the data space (registers, I/O, SRAM)."""
        return int(self._library.thumper_data(self._handle, address))

    def set_host_baud(self, baud: int) -> None:
        """Set the host's baud rate. If it differs from the chip's, both receive garbage; 0 always matches."""
        self._library.thumper_set_host_baud(self._handle, baud)

    def send(self, data: bytes) -> None:
        """Queue bytes for the chip; they are transmitted at line rate."""
        self._library.thumper_send(self._handle, data, len(data))

    def receive(self, limit: int) -> bytes:
        """Read up to `limit` bytes that have arrived."""
        return self.receive_stamped(limit)[0]

    def receive_stamped(self, limit: int) -> tuple[bytes, list[int]]:
        """Read up to `limit` bytes, with the cycle at which the stop bit of each ended."""
        data = ctypes.create_string_buffer(limit)
        cycles = (ctypes.c_uint64 * limit)()
        count = self._library.thumper_receive(self._handle, data, cycles, limit)
        return data.raw[:count], cycles[:count]

    def truth(self) -> Truth:
        """Return the current ground truth; needs `params`."""
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
        """Move the robot to a pose without turning its wheels."""
        self._library.thumper_place(
            self._handle, map_from_base.x_m, map_from_base.y_m, map_from_base.theta_rad
        )

    def hold(self, v_m_s: float, w_rad_s: float) -> None:
        """Block motion of the body in this direction, as an obstacle does, until `release`."""
        self._library.thumper_hold(self._handle, v_m_s, w_rad_s)

    def release(self) -> None:
        """Remove the obstacle set by `hold`."""
        self._library.thumper_release(self._handle)

    def set_attitude(self, *, pitch_rad: float = 0.0, roll_rad: float = 0.0) -> None:
        """Incline the body: front down, right side down. Only the accelerometer notices."""
        self._library.thumper_set_attitude(self._handle, pitch_rad, roll_rad)

    def set_climb(self, climb_rad: float) -> None:
        """Let the floor under the robot climb along its heading; gravity then acts on the motors."""
        self._library.thumper_set_climb(self._handle, climb_rad)

    def fit_gyroscope(
        self, *, bias_deg_s: float = 0.0, upside_down: bool = False, identity: int = 0x68
    ) -> None:
        """Connect an MPU-6050 to the TWI pins; without it the bus is empty. `identity`: its WHO_AM_I."""
        self._library.thumper_fit_gyroscope(self._handle, bias_deg_s, upside_down, identity)


def _check_elf(elf: Path) -> None:
    try:
        header = elf.open("rb").read(ELF_HEADER_BYTES)
    except OSError as error:
        raise ChipError(f"{elf}: cannot read the firmware; run `make firmware`") from error
    machine = int.from_bytes(header[18:20], "little")
    if header[:4] != b"\x7fELF" or machine != EM_AVR:
        raise ChipError(f"{elf}: not a firmware for an AVR; run `make firmware`")
