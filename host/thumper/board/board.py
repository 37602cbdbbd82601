"""The motor board: typed requests with retries, and the telemetry stream, over one serial port."""

import struct
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import serial

from thumper.board.clock import ClockFilter
from thumper.board.fault_texts import REFUSAL_REASONS
from thumper.board.framing import DELIMITER, Frame, FrameDecoder, encode_frame
from thumper.board.messages import (
    MESSAGES,
    PARAMETERS,
    SCHEMA_HASH,
    Ack,
    AckStatus,
    Command,
    CommandRequest,
    GetParameter,
    Identify,
    Identity,
    Message,
    ParameterValue,
    SetMotorPwm,
    SetParameter,
    SetWheelSpeeds,
    State,
    Telemetry,
)
from thumper.board.parameters import parameter_named
from thumper.common.errors import EXIT_NOT_THERE, ThumperError
from thumper.common.kinematics import WheelSpeeds
from thumper.common.serial_port import open_port, port_clock

REPLY_TIMEOUT_S = 0.1
REQUEST_TRIES = 5
READING_S = 0.1  # a board just started answers before it has measured its battery
STOP_TIMEOUT_S = 2.0
STOP_REPEAT_S = 0.02
BOOT_TIMEOUT_S = 4.0  # opening the port resets the board; its bootloader waits 1.3 s
ORDER_COPIES = 2  # ten orders a second, and two lost ones make the 300 ms of silence that stop the board


@dataclass(frozen=True, slots=True, kw_only=True)
class TelemetrySample:
    """One telemetry message and when the board took it, on the host's clock [s]."""

    time_s: float
    telemetry: Telemetry


class Board:
    """A board that answered the handshake. Use `Board.open`; `close` disarms it first."""

    def __init__(self, port: serial.Serial, name: str) -> None:
        self._port = port
        self._name = name
        self._clock = port_clock(port)
        self._decoder = FrameDecoder()
        self._fit = ClockFilter(tick_s=1e-6, wrap_ticks=2**32)
        self._sequence = 0
        self._samples: deque[TelemetrySample] = deque()
        self._replies: list[Message] = []
        self._schema_hash: int | None = None
        self._last_time_us: int | None = None
        self.restarted = False  # its clock went back: what it sends no longer continues what it sent
        self.identity = self._handshake()

    @classmethod
    def open(cls, url: str, *, baud: int) -> "Board":
        """Open the port and shake hands.

        Raises
        ------
        ThumperError
            No such port, nobody answers, or the firmware speaks another version of the protocol.
        """
        port = open_port(url, baud=baud, name="board")
        try:
            return cls(port, url)
        except BaseException:
            port.close()
            raise

    @property
    def receive_errors(self) -> int:
        """Frames from the board that did not check."""
        return self._decoder.errors

    def now_s(self) -> float:
        """The clock that telemetry is stamped on: the host's, or that of the simulated world."""
        return self._clock()

    @property
    def port(self) -> serial.Serial:
        """The port it is on."""
        return self._port

    def poll(self, timeout_s: float) -> list[TelemetrySample]:
        """Return the telemetry since the last call, oldest first; wait for some up to `timeout_s`."""
        deadline_s = self._clock() + timeout_s
        while not self._samples and self._clock() < deadline_s:
            self._receive(deadline_s - self._clock())
        samples = list(self._samples)
        self._samples.clear()
        return samples

    def set_wheel_speeds(self, speeds: WheelSpeeds) -> None:
        """Send the set-points; the board stops by itself when none comes for 300 ms."""
        self._send(
            SetWheelSpeeds(
                left=_int16(1000.0 * speeds.left_rad_s), right=_int16(1000.0 * speeds.right_rad_s)
            ),
            copies=ORDER_COPIES,
        )

    def set_motor_pwm(self, left: int, right: int) -> None:
        """Drive the motors open-loop, -255...255; the board stops by itself when none comes for 300 ms."""
        self._send(SetMotorPwm(left=_int16(left), right=_int16(right)), copies=ORDER_COPIES)

    def command(self, command: Command) -> None:
        """Have the board change its state; raises `ThumperError` when it refuses or does not answer."""
        self._acknowledged(CommandRequest(command=command), f"{command.name.lower()} command")

    def emergency_stop(self) -> None:
        """Stop the motors and latch it: sent ahead of all else, again and again until telemetry shows FAULT.

        Raises
        ------
        ThumperError
            The board did not confirm it within two seconds; it stops by itself when no other host drives it.
        """
        deadline_s = self._clock() + STOP_TIMEOUT_S
        stopped = False
        while not stopped and self._clock() < deadline_s:
            with self._explained():
                self._port.reset_output_buffer()
            self._send(CommandRequest(command=Command.E_STOP))
            known = len(self._samples)
            self._listen(STOP_REPEAT_S)
            stopped = any(sample.telemetry.state is State.FAULT for sample in list(self._samples)[known:])
        if not stopped:
            raise ThumperError("the board did not confirm the emergency stop; cut its power if it moves")

    def set_parameter(self, name: str, value: float) -> None:
        """Set a parameter in the unit that `docs/protocol.md` gives; the board checks the range as well."""
        spec = parameter_named(name)
        what = f"parameter {name} = {value:g} (allowed {spec.minimum:g}...{spec.maximum:g} {spec.unit})"
        try:
            self._acknowledged(SetParameter(index=spec.index, value=round(value * spec.scale)), what)
        except (struct.error, OverflowError, ValueError):  # far out of range, or no number: fits no wire
            raise ThumperError(f"refused {what}: {REFUSAL_REASONS[AckStatus.OUT_OF_RANGE]}") from None

    def get_parameter(self, name: str) -> float:
        """Return a parameter's present value in the unit that `docs/protocol.md` gives."""
        spec = parameter_named(name)
        for _ in range(REQUEST_TRIES):
            reply, _ = self._request(GetParameter(index=spec.index), ParameterValue)
            if isinstance(reply, ParameterValue) and reply.index == spec.index:
                return reply.value / spec.scale
        raise ThumperError(f"the board did not tell its parameter {name}; is the cable loose?")

    def round_trip_s(self, question: int, timeout_s: float) -> float | None:
        """Ask once for a parameter and return how long [s] the answer took, None if none came in time.

        Number the questions: each asks for another parameter than the last ones, so that an answer that comes
        late is not taken for that of the next question.
        """
        index = PARAMETERS[question % len(PARAMETERS)].index
        self._replies.clear()
        asked_s = self._clock()
        self._send(GetParameter(index=index))
        while (left_s := asked_s + timeout_s - self._clock()) > 0.0:
            self._receive(left_s)
            if any(isinstance(reply, ParameterValue) and reply.index == index for reply in self._replies):
                return self._clock() - asked_s
        return None

    def close(self) -> None:
        """Stop the motors, then close the port. Never raises: the board's own time-out is the second line."""
        try:
            self.set_wheel_speeds(WheelSpeeds())
            self.command(Command.DISARM)
        except ThumperError:
            pass
        finally:
            self._port.close()

    def _handshake(self) -> Identity:
        deadline_s = self._clock() + BOOT_TIMEOUT_S
        heard_bytes = 0
        while self._clock() < deadline_s:
            reply, received = self._request(Identify(), Identity)
            heard_bytes += received
            if self._schema_hash not in (None, SCHEMA_HASH):
                raise ThumperError(
                    f"the firmware on {self._name} speaks another protocol version ({self._schema_hash:08x}, "
                    f"this program {SCHEMA_HASH:08x}); flash the firmware that belongs to this program",
                    exit_code=EXIT_NOT_THERE,
                )
            if isinstance(reply, Identity):
                return reply
        sends = f"what it sends at {self._port.baudrate} baud is not the Thumper protocol"
        what = sends if heard_bytes else "it stays silent"
        raise ThumperError(
            f"no Thumper board answers on {self._name}: {what}; "
            "is it the right port and rate, flashed and powered?",
            exit_code=EXIT_NOT_THERE,
        )

    def _acknowledged(self, request: Message, what: str) -> None:
        refusal = ""
        for _ in range(REQUEST_TRIES):
            reply, _ = self._request(request, Ack)
            if isinstance(reply, Ack):
                if reply.status is AckStatus.OK:
                    return
                refusal = REFUSAL_REASONS[reply.status]
                if reply.status is not AckStatus.BATTERY_UNKNOWN:
                    break
                self._listen(READING_S)
        if refusal:
            raise ThumperError(f"the board refused the {what}: {refusal}")
        raise ThumperError(f"the board did not answer the {what}; is the cable loose?")

    def _request(self, request: Message, reply_type: type[Message]) -> tuple[Message | None, int]:
        """Send once and wait; return the reply that belongs to this request, and how many bytes came."""
        sequence = self._send(request)
        self._replies.clear()
        received = 0
        deadline_s = self._clock() + REPLY_TIMEOUT_S
        while self._clock() < deadline_s:
            received += self._receive(deadline_s - self._clock())
            for reply in self._replies:
                if isinstance(reply, Ack):
                    if (reply.request_id, reply.request_seq) == (request.ID, sequence):
                        return reply, received
                elif isinstance(reply, reply_type):
                    return reply, received
        return None, received

    def _listen(self, duration_s: float) -> None:
        """Take in what comes; the telemetry stays for `poll`."""
        deadline_s = self._clock() + duration_s
        while (left_s := deadline_s - self._clock()) > 0.0:
            self._receive(left_s)

    def _send(self, message: Message, *, copies: int = 1) -> int:
        """Send a frame, or the same one more often; returns its sequence number."""
        self._sequence = (self._sequence + 1) % 256
        # The delimiter ahead ends what noise left open: a spoilt one behind takes no second frame along.
        data = DELIMITER + encode_frame(message.ID, self._sequence, message.pack())
        with self._explained():
            self._port.write(copies * data)
        return self._sequence

    def _receive(self, timeout_s: float) -> int:
        """Read what is there, or wait for the first byte; sort what it completes. Returns the bytes read."""
        with self._explained():
            self._port.timeout = max(timeout_s, 0.0)
            data = self._port.read(max(1, self._port.in_waiting))
        received_s = self._clock()
        for frame in self._decoder.feed(data):
            self._sort(frame, received_s)
        return len(data)

    @contextmanager
    def _explained(self) -> Iterator[None]:
        """Tell a failing port in words."""
        try:
            yield
        except (serial.SerialException, OSError) as error:
            raise ThumperError(
                f"the board's port {self._name} fails ({error}); is the cable loose?",
                exit_code=EXIT_NOT_THERE,
            ) from error

    def _sort(self, frame: Frame, received_s: float) -> None:
        if frame.message_id == Identity.ID:  # its first field is the hash in every version
            self._schema_hash = int.from_bytes(frame.payload[:4], "little")
        message_type = MESSAGES.get(frame.message_id)
        if message_type is None:
            return
        try:
            message = message_type.unpack(frame.payload)
        except ValueError:  # another protocol version: the handshake will say so
            return
        if isinstance(message, Telemetry):
            last_us, self._last_time_us = self._last_time_us, message.time_us
            self.restarted |= last_us is not None and (message.time_us - last_us) % 2**32 > 2**31
            if self.restarted:
                return
            time_s = self._fit.host_time_s(message.time_us, received_s)
            self._samples.append(TelemetrySample(time_s=time_s, telemetry=message))
        else:
            self._replies.append(message)


def _int16(value: float) -> int:
    return max(-32768, min(32767, round(value)))
