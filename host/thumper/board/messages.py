"""Messages between host and firmware.

Generated from firmware/protocol/messages.toml by generate.py: edit that file, not this one.
Payloads only: `thumper.board.framing` adds id, sequence number, CRC and COBS encoding.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from struct import Struct
from types import MappingProxyType
from typing import ClassVar, Protocol, Self

SCHEMA_HASH: int = 0xDE20ECC9


class Command(IntEnum):
    """Commands from the host to the supervisor."""

    DISARM = 0  # Motors off.
    ARM = 1  # Enter the closed loop with a set-point of zero.
    E_STOP = 2  # Emergency stop: motors off, latched until CLEAR_FAULT.
    CLEAR_FAULT = 3  # Clear the latched fault; the robot is then disarmed.
    SAVE = 4  # Write the live parameters to the EEPROM. Answered after they are read back.
    LOAD = 5  # Load the saved parameters (the defaults if none are saved). Refused while armed.
    RESTORE_DEFAULTS = 6  # Restore the default parameters. The saved ones stay. Refused while armed.


class State(IntEnum):
    """The supervisor's state."""

    DISARMED = 0  # Motors off; the state after reset.
    CLOSED_LOOP = 1  # Wheel speeds are controlled.
    MANUAL = 2  # The host sets motor PWM directly; overrides the closed loop.
    FAULT = 3  # Motors off, latched; the fault gives the reason.


class Fault(IntEnum):
    """Why the firmware stopped the motors; latched."""

    NONE = 0  # No fault.
    LINK_LOST = 1  # No motion command for 300 ms while armed.
    LOW_BATTERY = 2  # Battery below battery_stop per cell; clears only above battery_rearm.
    E_STOP = 3  # The host sent E_STOP.
    STALL_LEFT = 4  # Fewer than 3 counts after 38 PWM s: blocked, or encoder or motor dead.
    STALL_RIGHT = 5  # As STALL_LEFT, for the right side.
    REVERSED_LEFT = 6  # Wrong direction after 38 PWM s: encoder or motor wires swapped.
    REVERSED_RIGHT = 7  # As REVERSED_LEFT, for the right side.
    LOST_EDGES = 8  # More than 30 encoder edges lost in 300 ms while armed: noise or a loose wire.
    OVER_CURRENT = 9  # A motor current above current_limit for 0.3 s.
    WATCHDOG = 10  # The firmware hung; the watchdog restarted it.
    BAD_PARAMETERS = 11  # The saved parameters are invalid; the defaults are in use.
    ADC_STOPPED = 12  # No analogue reading for 50 ms: battery and motor currents are unknown.
    HIGH_BATTERY = 13  # Battery above 4.5 V per cell: another pack, or its voltage divider is broken.
    INPUT_1 = 14  # Protecting input 1 is active: bumper, cliff sensor or emergency stop.
    INPUT_2 = 15  # As INPUT_1, for input 2.
    TILTED = 16  # The robot was tilted beyond tilt_limit for 0.3 s while armed.
    IMPACT = 17  # An impact above impact_limit while armed.


class AckStatus(IntEnum):
    """Result of a request."""

    OK = 0  # Done, or already in effect.
    UNKNOWN_COMMAND = 1  # No such command.
    UNKNOWN_PARAMETER = 2  # No parameter has this index.
    OUT_OF_RANGE = 3  # Value outside the parameter's range; the old value stays.
    FAULT_LATCHED = 4  # Refused while a fault is latched; send CLEAR_FAULT first.
    BATTERY_LOW = 5  # Refused until the battery is above battery_rearm per cell.
    NOT_SAVED = 6  # The EEPROM failed verification after the write.
    BATTERY_UNKNOWN = 7  # Refused until the first battery reading, 0.1 s after the start; try again.
    ARMED = 8  # Refused while armed; disarm first.
    BAD_PARAMETERS = 9  # The saved parameters are invalid; the live parameters stay.
    BATTERY_HIGH = 10  # Refused while the battery reads above 4.5 V per cell.
    INPUT_ACTIVE = 11  # Refused while a protecting input is active.
    PINS_IN_USE = 12  # Gyroscope and motor currents cannot both have A4 and A5.
    NO_ACCELEROMETER = 13  # This board has no accelerometer.


class BoardModel(IntEnum):
    """Board that the firmware was built for."""

    TREX = 1  # DAGU T'REX DG010 (ATmega328P, 16 MHz).
    NANO = 2  # Arduino Nano or Uno with a TB6612 or L298N driver.


class ResetCause(IntEnum):
    """Why the board last started."""

    UNKNOWN = 0  # The boot loader cleared the reset flags.
    POWER_ON = 1  # Power on.
    EXTERNAL = 2  # Reset pin; opening the serial port triggers it.
    BROWN_OUT = 3  # Supply voltage dip.
    WATCHDOG = 4  # The firmware hung; the watchdog stopped the motors and restarted it.


class GyroscopeState(IntEnum):
    """State of the gyroscope."""

    OFF = 0  # Not in use: the parameter `gyroscope` is 0.
    MISSING = 1  # No device answers, or it has stopped measuring; the board tries again.
    CALIBRATING = 2  # Its bias is unknown until the robot has been stationary for a second.
    READY = 3  # The heading is valid.


class ParameterSource(IntEnum):
    """Where the parameters were last loaded from or saved to."""

    DEFAULTS = 0  # Built-in defaults.
    SAVED = 1  # The EEPROM.


class Message(Protocol):
    """Interface of every message."""

    ID: ClassVar[int]

    def pack(self) -> bytes:
        """Return the payload; raise struct.error if a field does not fit its wire type."""
        ...

    @classmethod
    def unpack(cls, payload: bytes) -> Self:
        """Decode a payload; raise ValueError for a wrong length or an unknown enum value."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Identify:
    """Request `identity`."""

    ID: ClassVar[int] = 0x01
    _LAYOUT: ClassVar[Struct] = Struct("<")

    def pack(self) -> bytes:
        """Return the payload, 0 bytes."""
        return self._LAYOUT.pack()

    @classmethod
    def unpack(cls, payload: bytes) -> Self:
        """Decode a payload; raise ValueError for a wrong length or an unknown enum value."""
        if len(payload) != cls._LAYOUT.size:
            raise ValueError(f"identify needs {cls._LAYOUT.size} bytes, got {len(payload)}")
        return cls()


@dataclass(frozen=True, slots=True, kw_only=True)
class SetWheelSpeeds:
    """Wheel-speed set-points. They apply, and reset the link time-out, only in CLOSED_LOOP. No answer."""

    ID: ClassVar[int] = 0x02
    _LAYOUT: ClassVar[Struct] = Struct("<hh")

    left: int  # [mrad/s] Left side, positive forward, limited to +-17 rad/s.
    right: int  # [mrad/s] Right side, positive forward, limited to +-17 rad/s.

    def pack(self) -> bytes:
        """Return the payload, 4 bytes."""
        return self._LAYOUT.pack(self.left, self.right)

    @classmethod
    def unpack(cls, payload: bytes) -> Self:
        """Decode a payload; raise ValueError for a wrong length or an unknown enum value."""
        if len(payload) != cls._LAYOUT.size:
            raise ValueError(f"set_wheel_speeds needs {cls._LAYOUT.size} bytes, got {len(payload)}")
        left, right = cls._LAYOUT.unpack(payload)
        return cls(left=left, right=right)


@dataclass(frozen=True, slots=True, kw_only=True)
class SetMotorPwm:
    """Open-loop motor PWM. Switches an armed robot to MANUAL and resets its link time-out. No answer."""

    ID: ClassVar[int] = 0x03
    _LAYOUT: ClassVar[Struct] = Struct("<hh")

    left: int  # [PWM] Left side, positive forward, limited to +-255.
    right: int  # [PWM] Right side, positive forward, limited to +-255.

    def pack(self) -> bytes:
        """Return the payload, 4 bytes."""
        return self._LAYOUT.pack(self.left, self.right)

    @classmethod
    def unpack(cls, payload: bytes) -> Self:
        """Decode a payload; raise ValueError for a wrong length or an unknown enum value."""
        if len(payload) != cls._LAYOUT.size:
            raise ValueError(f"set_motor_pwm needs {cls._LAYOUT.size} bytes, got {len(payload)}")
        left, right = cls._LAYOUT.unpack(payload)
        return cls(left=left, right=right)


@dataclass(frozen=True, slots=True, kw_only=True)
class CommandRequest:
    """Command to the supervisor; answered by `ack`."""

    ID: ClassVar[int] = 0x04
    _LAYOUT: ClassVar[Struct] = Struct("<B")

    command: Command  # The command.

    def pack(self) -> bytes:
        """Return the payload, 1 bytes."""
        return self._LAYOUT.pack(self.command)

    @classmethod
    def unpack(cls, payload: bytes) -> Self:
        """Decode a payload; raise ValueError for a wrong length or an unknown enum value."""
        if len(payload) != cls._LAYOUT.size:
            raise ValueError(f"command_request needs {cls._LAYOUT.size} bytes, got {len(payload)}")
        (command,) = cls._LAYOUT.unpack(payload)
        return cls(command=Command(command))


@dataclass(frozen=True, slots=True, kw_only=True)
class SetParameter:
    """Set a live parameter; answered by `ack`. Refused out of range; from `counts_per_rev` on while armed."""

    ID: ClassVar[int] = 0x05
    _LAYOUT: ClassVar[Struct] = Struct("<Bh")

    index: int  # Parameter index.
    value: int  # Value times scale, rounded.

    def pack(self) -> bytes:
        """Return the payload, 3 bytes."""
        return self._LAYOUT.pack(self.index, self.value)

    @classmethod
    def unpack(cls, payload: bytes) -> Self:
        """Decode a payload; raise ValueError for a wrong length or an unknown enum value."""
        if len(payload) != cls._LAYOUT.size:
            raise ValueError(f"set_parameter needs {cls._LAYOUT.size} bytes, got {len(payload)}")
        index, value = cls._LAYOUT.unpack(payload)
        return cls(index=index, value=value)


@dataclass(frozen=True, slots=True, kw_only=True)
class GetParameter:
    """Request one parameter; answered by `parameter_value`, or by `ack` with UNKNOWN_PARAMETER."""

    ID: ClassVar[int] = 0x06
    _LAYOUT: ClassVar[Struct] = Struct("<B")

    index: int  # Parameter index.

    def pack(self) -> bytes:
        """Return the payload, 1 bytes."""
        return self._LAYOUT.pack(self.index)

    @classmethod
    def unpack(cls, payload: bytes) -> Self:
        """Decode a payload; raise ValueError for a wrong length or an unknown enum value."""
        if len(payload) != cls._LAYOUT.size:
            raise ValueError(f"get_parameter needs {cls._LAYOUT.size} bytes, got {len(payload)}")
        (index,) = cls._LAYOUT.unpack(payload)
        return cls(index=index)


@dataclass(frozen=True, slots=True, kw_only=True)
class Identity:
    """Firmware version, board and robot constants; the answer to `identify`."""

    ID: ClassVar[int] = 0x81
    _LAYOUT: ClassVar[Struct] = Struct("<IBBBBBBHHHBBHHHHHB")

    schema_hash: int  # CRC-32 of this schema; the first field in every version.
    version_major: int  # Firmware version, major.
    version_minor: int  # Firmware version, minor.
    version_patch: int  # Firmware version, patch.
    board: BoardModel  # Board that the firmware was built for.
    control_rate_Hz: int  # [Hz] Control rate.
    reset_cause: ResetCause  # Why the board last started.
    counts_per_rev: int  # [count] Encoder counts per wheel revolution.
    wheel_radius_mm: int  # [mm] Wheel radius.
    track_mm: int  # [mm] Distance between the middle wheels' contact points.
    reversed_sides: int  # Bits 0 to 3: left motor, right motor, left encoder, right encoder.
    battery_cells: int  # Cells of the battery in series.
    battery_stop_mV: int  # [mV] Voltage per cell below which the motors stop.
    battery_rearm_mV: int  # [mV] Voltage per cell above which the robot may be armed.
    current_scale: int  # [mA/512] Motor current per ADC count.
    current_zero: int  # [count] ADC reading of a motor current of zero.
    pwm_frequency_Hz: int  # [Hz] PWM frequency of the motors.
    parameters: ParameterSource  # Where they were last loaded from or saved to.

    def pack(self) -> bytes:
        """Return the payload, 29 bytes."""
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
            self.reversed_sides,
            self.battery_cells,
            self.battery_stop_mV,
            self.battery_rearm_mV,
            self.current_scale,
            self.current_zero,
            self.pwm_frequency_Hz,
            self.parameters,
        )

    @classmethod
    def unpack(cls, payload: bytes) -> Self:
        """Decode a payload; raise ValueError for a wrong length or an unknown enum value."""
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
            reversed_sides,
            battery_cells,
            battery_stop_mV,
            battery_rearm_mV,
            current_scale,
            current_zero,
            pwm_frequency_Hz,
            parameters,
        ) = cls._LAYOUT.unpack(payload)
        return cls(
            schema_hash=schema_hash,
            version_major=version_major,
            version_minor=version_minor,
            version_patch=version_patch,
            board=BoardModel(board),
            control_rate_Hz=control_rate_Hz,
            reset_cause=ResetCause(reset_cause),
            counts_per_rev=counts_per_rev,
            wheel_radius_mm=wheel_radius_mm,
            track_mm=track_mm,
            reversed_sides=reversed_sides,
            battery_cells=battery_cells,
            battery_stop_mV=battery_stop_mV,
            battery_rearm_mV=battery_rearm_mV,
            current_scale=current_scale,
            current_zero=current_zero,
            pwm_frequency_Hz=pwm_frequency_Hz,
            parameters=ParameterSource(parameters),
        )


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Telemetry:
    """Sent once per control tick. Speeds and set-points belong to the interval just ended."""

    ID: ClassVar[int] = 0x82
    _LAYOUT: ClassVar[Struct] = Struct("<IihhhhihhhhHHhhBBBHHHHB")

    time_us: int  # [us] Time of the tick since reset; wraps.
    left_count: int  # [count] Encoder position, increases forward; wraps.
    left_speed: int  # [mrad/s] Speed measured from the counts of the interval.
    left_setpoint: int  # [mrad/s] Ramped set-point of the same interval.
    left_pwm: int  # [PWM] Output from this tick until the next; 0 while a reversed motor rests that long.
    left_integral: int  # [PWM/64] Integral term of the output.
    right_count: int  # [count] Encoder position, increases forward; wraps.
    right_speed: int  # [mrad/s] Speed measured from the counts of the interval.
    right_setpoint: int  # [mrad/s] Ramped set-point of the same interval.
    right_pwm: int  # [PWM] Output from this tick until the next; 0 while a reversed motor rests that long.
    right_integral: int  # [PWM/64] Integral term of the output.
    lost_edges: int  # Encoder transitions of unknown direction since reset, both wheels; wraps.
    battery_mV: int  # [mV] Filtered battery voltage; 0 before the first reading.
    left_current_mA: int  # [mA] Motor current, averaged over 96 ms.
    right_current_mA: int  # [mA] Motor current, averaged over 96 ms.
    state: State  # Supervisor state.
    fault: Fault  # Latched fault.
    warnings: int  # Bit 0: battery below battery_rearm.
    rx_frames: int  # Valid frames received since reset; wraps.
    rx_errors: int  # Frames rejected since reset; wraps. One lost byte invalidates its frame.
    tx_dropped: int  # Control ticks without telemetry since reset, because the line was busy; wraps.
    heading: int  # [rev/65536] Heading by the gyroscope, counter-clockwise; wraps. Arbitrary before READY.
    gyroscope: GyroscopeState  # State of the gyroscope.

    def __repr__(self) -> str:
        left_rad_s, right_rad_s, battery_V = (
            value / 1000.0 for value in (self.left_speed, self.right_speed, self.battery_mV)
        )
        fault = f" ({self.fault.name})" if self.fault else ""
        return (
            f"<Telemetry: {self.state.name}{fault}, left {left_rad_s:z.2f} rad/s, "
            f"right {right_rad_s:z.2f} rad/s, {battery_V:.1f} V>"
        )

    def pack(self) -> bytes:
        """Return the payload, 48 bytes."""
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
            self.tx_dropped,
            self.heading,
            self.gyroscope,
        )

    @classmethod
    def unpack(cls, payload: bytes) -> Self:
        """Decode a payload; raise ValueError for a wrong length or an unknown enum value."""
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
            tx_dropped,
            heading,
            gyroscope,
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
            tx_dropped=tx_dropped,
            heading=heading,
            gyroscope=GyroscopeState(gyroscope),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Ack:
    """Answer to a request."""

    ID: ClassVar[int] = 0x83
    _LAYOUT: ClassVar[Struct] = Struct("<BBB")

    request_id: int  # Message id of the request.
    request_seq: int  # Sequence number of the request.
    status: AckStatus  # Result.

    def pack(self) -> bytes:
        """Return the payload, 3 bytes."""
        return self._LAYOUT.pack(self.request_id, self.request_seq, self.status)

    @classmethod
    def unpack(cls, payload: bytes) -> Self:
        """Decode a payload; raise ValueError for a wrong length or an unknown enum value."""
        if len(payload) != cls._LAYOUT.size:
            raise ValueError(f"ack needs {cls._LAYOUT.size} bytes, got {len(payload)}")
        request_id, request_seq, status = cls._LAYOUT.unpack(payload)
        return cls(request_id=request_id, request_seq=request_seq, status=AckStatus(status))


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterValue:
    """Current value of one parameter, with the sequence number of the request."""

    ID: ClassVar[int] = 0x84
    _LAYOUT: ClassVar[Struct] = Struct("<Bh")

    index: int  # Parameter index.
    value: int  # Value times scale.

    def pack(self) -> bytes:
        """Return the payload, 3 bytes."""
        return self._LAYOUT.pack(self.index, self.value)

    @classmethod
    def unpack(cls, payload: bytes) -> Self:
        """Decode a payload; raise ValueError for a wrong length or an unknown enum value."""
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
    """A live parameter; its wire value is `round(value * scale)`."""

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
        doc="Integral gain, applied once per control tick.",
    ),
    ParameterSpec(
        index=2,
        name="ks",
        unit="PWM",
        minimum=0.0,
        maximum=100.0,
        default=19.3,
        scale=128.0,
        doc="Feed-forward for static friction, at 3.7 V per cell.",
    ),
    ParameterSpec(
        index=3,
        name="kv",
        unit="PWM/(rad/s)",
        minimum=0.0,
        maximum=60.0,
        default=17.12,
        scale=524.288,
        doc="Feed-forward for speed, at 3.7 V per cell. 0 also disables ka and the speed prediction.",
    ),
    ParameterSpec(
        index=4,
        name="ka",
        unit="PWM/(rad/s^2)",
        minimum=0.0,
        maximum=20.0,
        default=1.284,
        scale=524.288,
        doc="Feed-forward for acceleration, at 3.7 V per cell. ka / kv is the wheel's time constant.",
    ),
    ParameterSpec(
        index=5,
        name="acceleration",
        unit="rad/s^2",
        minimum=0.0,
        maximum=200.0,
        default=8.0,
        scale=100.0,
        doc="Acceleration limit of the set-point ramp; 0 = no ramp.",
    ),
    ParameterSpec(
        index=6,
        name="deceleration",
        unit="rad/s^2",
        minimum=0.0,
        maximum=200.0,
        default=16.0,
        scale=100.0,
        doc="Deceleration limit of the set-point ramp; 0 = as acceleration.",
    ),
    ParameterSpec(
        index=7,
        name="current_limit",
        unit="A",
        minimum=1.0,
        maximum=20.0,
        default=8.0,
        scale=1000.0,
        doc="A motor current above this for 0.3 s is a fault. The sensor measures up to 20 A.",
    ),
    ParameterSpec(
        index=8,
        name="counts_per_rev",
        unit="count",
        minimum=40.0,
        maximum=30000.0,
        default=1200.0,
        scale=1.0,
        doc="Encoder counts per wheel revolution.",
    ),
    ParameterSpec(
        index=9,
        name="wheel_radius",
        unit="mm",
        minimum=10.0,
        maximum=500.0,
        default=62.0,
        scale=1.0,
        doc="Wheel radius.",
    ),
    ParameterSpec(
        index=10,
        name="track",
        unit="mm",
        minimum=50.0,
        maximum=2000.0,
        default=245.0,
        scale=1.0,
        doc="Distance between the middle wheels' contact points.",
    ),
    ParameterSpec(
        index=11,
        name="left_motor_reversed",
        unit="",
        minimum=0.0,
        maximum=1.0,
        default=0.0,
        scale=1.0,
        doc="1: the left motor runs forward when its pins say reverse.",
    ),
    ParameterSpec(
        index=12,
        name="right_motor_reversed",
        unit="",
        minimum=0.0,
        maximum=1.0,
        default=0.0,
        scale=1.0,
        doc="1: the right motor runs forward when its pins say reverse.",
    ),
    ParameterSpec(
        index=13,
        name="left_encoder_reversed",
        unit="",
        minimum=0.0,
        maximum=1.0,
        default=0.0,
        scale=1.0,
        doc="1: the left encoder counts down while the wheel rolls forward.",
    ),
    ParameterSpec(
        index=14,
        name="right_encoder_reversed",
        unit="",
        minimum=0.0,
        maximum=1.0,
        default=0.0,
        scale=1.0,
        doc="1: the right encoder counts down while the wheel rolls forward.",
    ),
    ParameterSpec(
        index=15,
        name="battery_cells",
        unit="",
        minimum=1.0,
        maximum=7.0,
        default=2.0,
        scale=1.0,
        doc="Battery cells in series. Above 4.5 V per cell is a fault.",
    ),
    ParameterSpec(
        index=16,
        name="battery_stop",
        unit="V",
        minimum=2.5,
        maximum=4.0,
        default=3.2,
        scale=1000.0,
        doc="Voltage per cell below which the motors stop.",
    ),
    ParameterSpec(
        index=17,
        name="battery_rearm",
        unit="V",
        minimum=2.6,
        maximum=4.2,
        default=3.5,
        scale=1000.0,
        doc="Voltage per cell above which the robot may be armed.",
    ),
    ParameterSpec(
        index=18,
        name="current_scale",
        unit="mA",
        minimum=1.0,
        maximum=60.0,
        default=48.828125,
        scale=512.0,
        doc="Motor current per ADC count.",
    ),
    ParameterSpec(
        index=19,
        name="current_zero",
        unit="count",
        minimum=0.0,
        maximum=1023.0,
        default=511.0,
        scale=1.0,
        doc="ADC reading of a motor current of zero.",
    ),
    ParameterSpec(
        index=20,
        name="stall_current",
        unit="A",
        minimum=0.0,
        maximum=60.0,
        default=15.0,
        scale=500.0,
        doc="Current of a side's blocked motors at full PWM; 0 = unknown.",
    ),
    ParameterSpec(
        index=21,
        name="pwm_frequency",
        unit="Hz",
        minimum=122.0,
        maximum=31373.0,
        default=122.0,
        scale=1.0,
        doc="PWM frequency: 122, 245, 490, 980, 3922 or 31373 (silent); another value is rounded down.",
    ),
    ParameterSpec(
        index=22,
        name="input_1",
        unit="",
        minimum=0.0,
        maximum=2.0,
        default=0.0,
        scale=1.0,
        doc="Protecting input 1 stops the motors: 0 never, 1 while it is low, 2 while it is high.",
    ),
    ParameterSpec(
        index=23,
        name="input_2",
        unit="",
        minimum=0.0,
        maximum=2.0,
        default=0.0,
        scale=1.0,
        doc="As input_1, for input 2.",
    ),
    ParameterSpec(
        index=24,
        name="gyroscope",
        unit="",
        minimum=0.0,
        maximum=2.0,
        default=0.0,
        scale=1.0,
        doc="MPU-6050 at A4 and A5: 0 none, 1 its z axis points up, 2 down.",
    ),
    ParameterSpec(
        index=25,
        name="currents_at_a4",
        unit="",
        minimum=0.0,
        maximum=1.0,
        default=0.0,
        scale=1.0,
        doc="Motor currents: 0 at A6 and A7; 1 at A4 and A5, for an Uno. Then there is no gyroscope.",
    ),
    ParameterSpec(
        index=26,
        name="tilt_limit",
        unit="V",
        minimum=-1.5,
        maximum=1.5,
        default=0.0,
        scale=51.2,
        doc="Tilted if the accelerometer's z is less than this above 1.65 V; 0 = never, negative: z down.",
    ),
    ParameterSpec(
        index=27,
        name="impact_limit",
        unit="V",
        minimum=0.0,
        maximum=3.0,
        default=0.0,
        scale=51.2,
        doc="Impact if the accelerometer's output changes by more than this in 3 ms; 0 = never.",
    ),
)
