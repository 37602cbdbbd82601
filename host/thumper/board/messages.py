"""The messages between host and firmware.

Generated from firmware/protocol/messages.toml by generate.py: edit that file, not this one.
Payloads only; `thumper.board.framing` adds id, sequence number, CRC and COBS around them.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from struct import Struct
from types import MappingProxyType
from typing import ClassVar, Protocol, Self

SCHEMA_HASH: int = 0x69B7F337


class Command(IntEnum):
    """What the host may ask of the supervisor."""

    DISARM = 0  # Motors off.
    ARM = 1  # Closed loop, starting from set-point zero.
    E_STOP = 2  # Motors off and latched until CLEAR_FAULT.
    CLEAR_FAULT = 3  # Unlatch the fault; the robot is then disarmed.
    SAVE = 4  # Write the live parameters to the EEPROM; answered once they are read back.
    LOAD = 5  # Take the saved parameters (the defaults, where none were saved); refused while armed.
    RESTORE_DEFAULTS = 6  # Take the default parameters; what is saved stays.


class State(IntEnum):
    """The supervisor's state."""

    DISARMED = 0  # Motors off; the state after reset.
    CLOSED_LOOP = 1  # Wheel speeds are controlled.
    MANUAL = 2  # Motor PWM is set directly; overrides the closed loop.
    FAULT = 3  # Motors off; latched, the fault says why.


class Fault(IntEnum):
    """Why the motors were stopped; latched."""

    NONE = 0  # No fault.
    LINK_LOST = 1  # No motion command for 300 ms while armed.
    LOW_BATTERY = 2  # Battery below 6.4 V; clears only above 7.0 V.
    E_STOP = 3  # Stopped by the host's E_STOP command.
    STALL_LEFT = 4  # Pushed by 38 PWM s and fewer than 3 counts: blocked, or encoder or motor dead.
    STALL_RIGHT = 5  # Likewise.
    REVERSED_LEFT = 6  # Likewise, and it counts the other way: encoder or motor wires swapped.
    REVERSED_RIGHT = 7  # Likewise.
    LOST_EDGES = 8  # More than 30 encoder edges lost in 300 ms while armed: noise or a loose wire.
    OVER_CURRENT = 9  # A motor current above current_limit for 0.3 s.
    WATCHDOG = 10  # The firmware hung and was restarted.
    BAD_PARAMETERS = 11  # What the EEPROM holds cannot be read; the defaults are in use.


class AckStatus(IntEnum):
    """The answer to a request."""

    OK = 0  # Done (or already so).
    UNKNOWN_COMMAND = 1  # No such command.
    UNKNOWN_PARAMETER = 2  # No parameter has this index.
    OUT_OF_RANGE = 3  # Value outside the parameter's range; the old one stays.
    FAULT_LATCHED = 4  # Refused while a fault is latched: clear it first.
    BATTERY_LOW = 5  # Refused until the battery is above 7.0 V.
    NOT_SAVED = 6  # The EEPROM does not hold what was written to it.
    BATTERY_UNKNOWN = 7  # Refused until the first battery reading, 0.1 s after the start: ask again.
    ARMED = 8  # Refused while armed: disarm first.
    BAD_PARAMETERS = 9  # What the EEPROM holds cannot be read; the live parameters stay.


class Board(IntEnum):
    """The board the firmware was built for."""

    TREX = 1  # DAGU T'REX DG010 (ATmega328P, 16 MHz).
    NANO = 2  # Arduino Nano or Uno with a TB6612 or L298N driver.


class ResetCause(IntEnum):
    """Why the board last started."""

    UNKNOWN = 0  # A boot loader cleared the flags.
    POWER_ON = 1  # Power came on.
    EXTERNAL = 2  # Reset pin; opening the port does this.
    BROWN_OUT = 3  # Supply dipped.
    WATCHDOG = 4  # The firmware hung; the watchdog stopped the motors and restarted it.


class ParameterSource(IntEnum):
    """What the parameters were last taken from, or saved to."""

    DEFAULTS = 0  # The firmware's own.
    SAVED = 1  # The EEPROM.


class Message(Protocol):
    """What every message offers."""

    ID: ClassVar[int]

    def pack(self) -> bytes:
        """Return the payload; raises struct.error if a field does not fit its wire type."""
        ...

    @classmethod
    def unpack(cls, payload: bytes) -> Self:
        """Read a payload; raises ValueError on a wrong length or an unknown enum value."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Identify:
    """Ask for `identity`."""

    ID: ClassVar[int] = 0x01
    _LAYOUT: ClassVar[Struct] = Struct("<")

    def pack(self) -> bytes:
        """Return the 0 bytes of the payload."""
        return self._LAYOUT.pack()

    @classmethod
    def unpack(cls, payload: bytes) -> Self:
        """Read a payload; raises ValueError on a wrong length or an unknown enum value."""
        if len(payload) != cls._LAYOUT.size:
            raise ValueError(f"identify needs {cls._LAYOUT.size} bytes, got {len(payload)}")
        return cls()


@dataclass(frozen=True, slots=True, kw_only=True)
class SetWheelSpeeds:
    """Wheel-speed set-points; in CLOSED_LOOP they act and feed the link time-out. No answer."""

    ID: ClassVar[int] = 0x02
    _LAYOUT: ClassVar[Struct] = Struct("<hh")

    left: int  # [mrad/s] Left side, forward positive; limited to +-17 rad/s.
    right: int  # [mrad/s] Right side, likewise.

    def pack(self) -> bytes:
        """Return the 4 bytes of the payload."""
        return self._LAYOUT.pack(self.left, self.right)

    @classmethod
    def unpack(cls, payload: bytes) -> Self:
        """Read a payload; raises ValueError on a wrong length or an unknown enum value."""
        if len(payload) != cls._LAYOUT.size:
            raise ValueError(f"set_wheel_speeds needs {cls._LAYOUT.size} bytes, got {len(payload)}")
        left, right = cls._LAYOUT.unpack(payload)
        return cls(left=left, right=right)


@dataclass(frozen=True, slots=True, kw_only=True)
class SetMotorPwm:
    """Open-loop PWM; takes an armed robot to MANUAL and feeds the link time-out there. No answer."""

    ID: ClassVar[int] = 0x03
    _LAYOUT: ClassVar[Struct] = Struct("<hh")

    left: int  # [PWM] Left side, forward positive; limited to +-255.
    right: int  # [PWM] Right side, likewise.

    def pack(self) -> bytes:
        """Return the 4 bytes of the payload."""
        return self._LAYOUT.pack(self.left, self.right)

    @classmethod
    def unpack(cls, payload: bytes) -> Self:
        """Read a payload; raises ValueError on a wrong length or an unknown enum value."""
        if len(payload) != cls._LAYOUT.size:
            raise ValueError(f"set_motor_pwm needs {cls._LAYOUT.size} bytes, got {len(payload)}")
        left, right = cls._LAYOUT.unpack(payload)
        return cls(left=left, right=right)


@dataclass(frozen=True, slots=True, kw_only=True)
class CommandRequest:
    """A command to the supervisor; answered by `ack`."""

    ID: ClassVar[int] = 0x04
    _LAYOUT: ClassVar[Struct] = Struct("<B")

    command: Command  # What to do.

    def pack(self) -> bytes:
        """Return the 1 bytes of the payload."""
        return self._LAYOUT.pack(self.command)

    @classmethod
    def unpack(cls, payload: bytes) -> Self:
        """Read a payload; raises ValueError on a wrong length or an unknown enum value."""
        if len(payload) != cls._LAYOUT.size:
            raise ValueError(f"command_request needs {cls._LAYOUT.size} bytes, got {len(payload)}")
        (command,) = cls._LAYOUT.unpack(payload)
        return cls(command=Command(command))


@dataclass(frozen=True, slots=True, kw_only=True)
class SetParameter:
    """Set a parameter, until the next reset or for good (SAVE); answered by `ack`. Out of range: refused."""

    ID: ClassVar[int] = 0x05
    _LAYOUT: ClassVar[Struct] = Struct("<Bh")

    index: int  # The parameter.
    value: int  # Its value times its scale, rounded.

    def pack(self) -> bytes:
        """Return the 3 bytes of the payload."""
        return self._LAYOUT.pack(self.index, self.value)

    @classmethod
    def unpack(cls, payload: bytes) -> Self:
        """Read a payload; raises ValueError on a wrong length or an unknown enum value."""
        if len(payload) != cls._LAYOUT.size:
            raise ValueError(f"set_parameter needs {cls._LAYOUT.size} bytes, got {len(payload)}")
        index, value = cls._LAYOUT.unpack(payload)
        return cls(index=index, value=value)


@dataclass(frozen=True, slots=True, kw_only=True)
class GetParameter:
    """Ask for one parameter; answered by `parameter_value`, or by `ack` with UNKNOWN_PARAMETER."""

    ID: ClassVar[int] = 0x06
    _LAYOUT: ClassVar[Struct] = Struct("<B")

    index: int  # The parameter.

    def pack(self) -> bytes:
        """Return the 1 bytes of the payload."""
        return self._LAYOUT.pack(self.index)

    @classmethod
    def unpack(cls, payload: bytes) -> Self:
        """Read a payload; raises ValueError on a wrong length or an unknown enum value."""
        if len(payload) != cls._LAYOUT.size:
            raise ValueError(f"get_parameter needs {cls._LAYOUT.size} bytes, got {len(payload)}")
        (index,) = cls._LAYOUT.unpack(payload)
        return cls(index=index)


@dataclass(frozen=True, slots=True, kw_only=True)
class Identity:
    """Who is there."""

    ID: ClassVar[int] = 0x81
    _LAYOUT: ClassVar[Struct] = Struct("<IBBBBBBHHHB")

    schema_hash: int  # CRC-32 of this schema; first in every version, for ever.
    version_major: int  # Firmware version.
    version_minor: int  # Firmware version.
    version_patch: int  # Firmware version.
    board: Board  # Board the firmware was built for.
    control_rate_Hz: int  # [Hz] Control ticks a second.
    reset_cause: ResetCause  # Why the board last started.
    counts_per_rev: int  # [count] Encoder counts a wheel turn.
    wheel_radius_mm: int  # [mm] Wheel radius.
    track_mm: int  # [mm] Distance between the middle wheels' contact points.
    parameters: ParameterSource  # What they were last taken from, or saved to.

    def pack(self) -> bytes:
        """Return the 17 bytes of the payload."""
        return self._LAYOUT.pack(
            self.schema_hash,
            self.version_major,
            self.version_minor,
            self.version_patch,
            self.board,
            self.control_rate_Hz,
            self.reset_cause,
            self.counts_per_rev,
            self.wheel_radius_mm,
            self.track_mm,
            self.parameters,
        )

    @classmethod
    def unpack(cls, payload: bytes) -> Self:
        """Read a payload; raises ValueError on a wrong length or an unknown enum value."""
        if len(payload) != cls._LAYOUT.size:
            raise ValueError(f"identity needs {cls._LAYOUT.size} bytes, got {len(payload)}")
        (
            schema_hash,
            version_major,
            version_minor,
            version_patch,
            board,
            control_rate_Hz,
            reset_cause,
            counts_per_rev,
            wheel_radius_mm,
            track_mm,
            parameters,
        ) = cls._LAYOUT.unpack(payload)
        return cls(
            schema_hash=schema_hash,
            version_major=version_major,
            version_minor=version_minor,
            version_patch=version_patch,
            board=Board(board),
            control_rate_Hz=control_rate_Hz,
            reset_cause=ResetCause(reset_cause),
            counts_per_rev=counts_per_rev,
            wheel_radius_mm=wheel_radius_mm,
            track_mm=track_mm,
            parameters=ParameterSource(parameters),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Telemetry:
    """Sent once a control tick. Speeds and set-points belong to the interval just ended."""

    ID: ClassVar[int] = 0x82
    _LAYOUT: ClassVar[Struct] = Struct("<IihhhhihhhhHHhhBBBHH")

    time_us: int  # [us] Time of the tick since reset; wraps.
    left_count: int  # [count] Encoder position, rises forward; wraps.
    left_speed: int  # [mrad/s] Counts of the interval as a speed.
    left_setpoint: int  # [mrad/s] Ramped set-point of the same interval.
    left_pwm: int  # [PWM] Output set at this tick, held until the next.
    left_integral: int  # [PWM/64] Integral part of the output.
    right_count: int  # [count] Likewise.
    right_speed: int  # [mrad/s] Likewise.
    right_setpoint: int  # [mrad/s] Likewise.
    right_pwm: int  # [PWM] Likewise.
    right_integral: int  # [PWM/64] Likewise.
    lost_edges: int  # Encoder transitions of unknown direction since reset, both wheels; wraps.
    battery_mV: int  # [mV] Filtered battery voltage; 0 before the first reading.
    left_current_mA: int  # [mA] Motor current, averaged over 96 ms.
    right_current_mA: int  # [mA] Likewise.
    state: State  # Supervisor state.
    fault: Fault  # Latched fault.
    warnings: int  # Bit 0: battery below 7.0 V.
    rx_frames: int  # Good frames received since reset; wraps.
    rx_errors: int  # Frames refused since reset; a lost byte spoils its frame; wraps.

    def pack(self) -> bytes:
        """Return the 43 bytes of the payload."""
        return self._LAYOUT.pack(
            self.time_us,
            self.left_count,
            self.left_speed,
            self.left_setpoint,
            self.left_pwm,
            self.left_integral,
            self.right_count,
            self.right_speed,
            self.right_setpoint,
            self.right_pwm,
            self.right_integral,
            self.lost_edges,
            self.battery_mV,
            self.left_current_mA,
            self.right_current_mA,
            self.state,
            self.fault,
            self.warnings,
            self.rx_frames,
            self.rx_errors,
        )

    @classmethod
    def unpack(cls, payload: bytes) -> Self:
        """Read a payload; raises ValueError on a wrong length or an unknown enum value."""
        if len(payload) != cls._LAYOUT.size:
            raise ValueError(f"telemetry needs {cls._LAYOUT.size} bytes, got {len(payload)}")
        (
            time_us,
            left_count,
            left_speed,
            left_setpoint,
            left_pwm,
            left_integral,
            right_count,
            right_speed,
            right_setpoint,
            right_pwm,
            right_integral,
            lost_edges,
            battery_mV,
            left_current_mA,
            right_current_mA,
            state,
            fault,
            warnings,
            rx_frames,
            rx_errors,
        ) = cls._LAYOUT.unpack(payload)
        return cls(
            time_us=time_us,
            left_count=left_count,
            left_speed=left_speed,
            left_setpoint=left_setpoint,
            left_pwm=left_pwm,
            left_integral=left_integral,
            right_count=right_count,
            right_speed=right_speed,
            right_setpoint=right_setpoint,
            right_pwm=right_pwm,
            right_integral=right_integral,
            lost_edges=lost_edges,
            battery_mV=battery_mV,
            left_current_mA=left_current_mA,
            right_current_mA=right_current_mA,
            state=State(state),
            fault=Fault(fault),
            warnings=warnings,
            rx_frames=rx_frames,
            rx_errors=rx_errors,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Ack:
    """The answer to a request."""

    ID: ClassVar[int] = 0x83
    _LAYOUT: ClassVar[Struct] = Struct("<BBB")

    request_id: int  # Message id of the request.
    request_seq: int  # Its sequence number.
    status: AckStatus  # What became of it.

    def pack(self) -> bytes:
        """Return the 3 bytes of the payload."""
        return self._LAYOUT.pack(self.request_id, self.request_seq, self.status)

    @classmethod
    def unpack(cls, payload: bytes) -> Self:
        """Read a payload; raises ValueError on a wrong length or an unknown enum value."""
        if len(payload) != cls._LAYOUT.size:
            raise ValueError(f"ack needs {cls._LAYOUT.size} bytes, got {len(payload)}")
        request_id, request_seq, status = cls._LAYOUT.unpack(payload)
        return cls(request_id=request_id, request_seq=request_seq, status=AckStatus(status))


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterValue:
    """One parameter's present value; carries the sequence number of the request it answers."""

    ID: ClassVar[int] = 0x84
    _LAYOUT: ClassVar[Struct] = Struct("<Bh")

    index: int  # The parameter.
    value: int  # Its value times its scale.

    def pack(self) -> bytes:
        """Return the 3 bytes of the payload."""
        return self._LAYOUT.pack(self.index, self.value)

    @classmethod
    def unpack(cls, payload: bytes) -> Self:
        """Read a payload; raises ValueError on a wrong length or an unknown enum value."""
        if len(payload) != cls._LAYOUT.size:
            raise ValueError(f"parameter_value needs {cls._LAYOUT.size} bytes, got {len(payload)}")
        index, value = cls._LAYOUT.unpack(payload)
        return cls(index=index, value=value)


MESSAGES: Mapping[int, type[Message]] = MappingProxyType(
    {
        Identify.ID: Identify,
        SetWheelSpeeds.ID: SetWheelSpeeds,
        SetMotorPwm.ID: SetMotorPwm,
        CommandRequest.ID: CommandRequest,
        SetParameter.ID: SetParameter,
        GetParameter.ID: GetParameter,
        Identity.ID: Identity,
        Telemetry.ID: Telemetry,
        Ack.ID: Ack,
        ParameterValue.ID: ParameterValue,
    }
)


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterSpec:
    """One live parameter. On the wire it is `round(value * scale)`."""

    index: int
    name: str
    unit: str
    minimum: float
    maximum: float
    default: float
    scale: float
    doc: str


PARAMETERS: tuple[ParameterSpec, ...] = (
    ParameterSpec(
        index=0,
        name="kp",
        unit="PWM/(rad/s)",
        minimum=0.0,
        maximum=60.0,
        default=6.1,
        scale=524.288,
        doc="Proportional gain.",
    ),
    ParameterSpec(
        index=1,
        name="ki",
        unit="PWM/(rad/s) per tick",
        minimum=0.0,
        maximum=30.0,
        default=10.9,
        scale=524.288,
        doc="Integral gain; added once a control tick.",
    ),
    ParameterSpec(
        index=2,
        name="ks",
        unit="PWM",
        minimum=0.0,
        maximum=100.0,
        default=19.3,
        scale=128.0,
        doc="Feed-forward against dry friction, at 7.4 V.",
    ),
    ParameterSpec(
        index=3,
        name="kv",
        unit="PWM/(rad/s)",
        minimum=0.0,
        maximum=60.0,
        default=17.12,
        scale=524.288,
        doc="Feed-forward per speed, at 7.4 V. 0 switches ka and the speed prediction off too.",
    ),
    ParameterSpec(
        index=4,
        name="ka",
        unit="PWM/(rad/s^2)",
        minimum=0.0,
        maximum=20.0,
        default=1.284,
        scale=524.288,
        doc="Feed-forward per acceleration, at 7.4 V; ka / kv is the wheel's time constant.",
    ),
    ParameterSpec(
        index=5,
        name="acceleration",
        unit="rad/s^2",
        minimum=0.0,
        maximum=200.0,
        default=8.0,
        scale=100.0,
        doc="Limit of the set-point ramp; 0 = no ramp.",
    ),
    ParameterSpec(
        index=6,
        name="current_limit",
        unit="A",
        minimum=1.0,
        maximum=20.0,
        default=8.0,
        scale=1000.0,
        doc="A motor current above it for 0.3 s is a fault; the sensor ends at 20 A.",
    ),
)
