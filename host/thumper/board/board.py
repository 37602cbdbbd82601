"""The motor board: typed requests with retries, and the telemetry stream, over one serial port."""

import struct
from collections import deque
from collections.abc import Generator, Iterator
from dataclasses import dataclass

from thumper.board.clock import ClockFilter
from thumper.board.fault_texts import REFUSAL_REASONS
from thumper.board.framing import DELIMITER, Frame, FrameDecoder, encode_frame
from thumper.board.gyroscope import GyroIncrements
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
from thumper.common.serial_port import SerialPort, open_port

REPLY_TIMEOUT_S = 0.1
SAVE_POLL_S = 0.01
SAVE_TIMEOUT_S = 0.5  # a byte of the EEPROM takes 3.4 ms; a request that is repeated saves again
REQUEST_TRIES = 5
BATTERY_RETRY_S = 0.1  # after a reset the board answers before it has measured its battery
STOP_TIMEOUT_S = 2.0
STOP_REPEAT_S = 0.02
BOOT_TIMEOUT_S = 4.0  # opening the port resets the board; its boot loader waits 1.3 s
# At ten commands per second, two lost ones make the 300 ms of silence that stop the board.
COMMAND_COPIES = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class TelemetrySample:
    """One telemetry message, and when the board took it on the host's clock [s]."""

    time_s: float
    telemetry: Telemetry
    gyro_increment_rad: float | None = None  # since the last one, counter-clockwise; None without a gyroscope


class Board:
    """A board that answered the handshake. Create it with `Board.open`; `close` disarms it first."""

    def __init__(self, port: SerialPort, *, handshake: bool = True) -> None:
        """Shake hands on an open port; without `handshake`, the caller runs the steps of `_handshake`."""
        self._port = port
        self._decoder = FrameDecoder()
        self._clock_filter = ClockFilter(tick_s=1e-6, wrap_ticks=2**32)
        self._gyro_increments = GyroIncrements()
        self._sequence = 0
        self._samples: deque[TelemetrySample] = deque()
        self._replies: list[Message] = []
        self._schema_hash: int | None = None
        self._last_time_us: int | None = None
        self.restarted = False  # its clock went back; the telemetry stream ends here
        self._identity: Identity | None = None
        if handshake:
            for _ in self._handshake():
                pass

    @classmethod
    def open(cls, url: str, *, baud: int) -> "Board":
        """Open the port and do the handshake.

        Raises
        ------
        ThumperError
            The port does not exist, no board answers, or its firmware speaks another protocol version.
        """
        connecting = cls.connect(url, baud=baud)
        while True:
            try:
                next(connecting)
            except StopIteration as connected:
                board: Board = connected.value
                return board

    @classmethod
    def connect(cls, url: str, *, baud: int) -> "Generator[None, None, Board]":
        """Open the port and do the handshake, in steps of 0.1 s; return the board.

        Raises
        ------
        ThumperError
            As `open`.
        """
        port = open_port(url, baud=baud, name="board")
        try:
            board = cls(port, handshake=False)
            yield from board._handshake()
        except BaseException:
            port.close()
            raise
        return board

    @property
    def identity(self) -> Identity:
        """What the board answered in the handshake: firmware, geometry, cause of the last reset."""
        assert self._identity is not None
        return self._identity

    @property
    def receive_errors(self) -> int:
        """Number of frames from the board that failed the CRC."""
        return self._decoder.errors

    def now_s(self) -> float:
        """Return the time [s] on the clock of the telemetry stamps: the host's or the simulation's."""
        return self._port.now_s()

    @property
    def port(self) -> SerialPort:
        """The port that the board is on."""
        return self._port

    def poll(self, timeout_s: float) -> list[TelemetrySample]:
        """Return the telemetry since the last call, oldest first; wait up to `timeout_s` for the first."""
        deadline_s = self.now_s() + timeout_s
        while not self._samples and self.now_s() < deadline_s:
            self._receive(deadline_s - self.now_s())
        samples = list(self._samples)
        self._samples.clear()
        return samples

    def set_wheel_speeds(self, speeds: WheelSpeeds) -> None:
        """Send the set-points. The board stops the motors if it receives none for 300 ms."""
        self._send(
            SetWheelSpeeds(
                left=_int16(1000.0 * speeds.left_rad_s), right=_int16(1000.0 * speeds.right_rad_s)
            ),
            copies=COMMAND_COPIES,
        )

    def set_motor_pwm(self, left: int, right: int) -> None:
        """Drive the motors open-loop, -255...255. The board stops them if it receives none for 300 ms."""
        self._send(SetMotorPwm(left=_int16(left), right=_int16(right)), copies=COMMAND_COPIES)

    def command(self, command: Command) -> None:
        """Change the board's state; raise `ThumperError` if it refuses or does not answer."""
        if command is Command.SAVE:
            for _ in self.save():
                pass
            return
        self._request_ack(CommandRequest(command=command), f"{command.name.lower()} command")

    def save(self) -> Iterator[None]:
        """Store the parameters in the board's EEPROM. Yields until it has: send commands and poll meanwhile.

        It takes a quarter of a second, after which a board that receives no command stops the motors.

        Raises
        ------
        ThumperError
            The board refuses or does not answer.
        """
        request = CommandRequest(command=Command.SAVE)
        for _ in range(REQUEST_TRIES):
            sequence = self._send(request)
            self._replies.clear()
            deadline_s = self.now_s() + SAVE_TIMEOUT_S
            while self.now_s() < deadline_s:
                self._receive(SAVE_POLL_S)
                for reply in self._replies:
                    if isinstance(reply, Ack) and reply.request_seq == sequence:
                        if reply.status is not AckStatus.OK:
                            reason = REFUSAL_REASONS[reply.status]
                            raise ThumperError(f"the board refused the save command: {reason}")
                        return
                yield
        raise ThumperError("the board did not answer the save command; is the cable loose?")

    def emergency_stop(self) -> None:
        """Stop the motors and latch the stop. Repeats the command until the telemetry shows FAULT.

        The command overtakes everything that waits to be sent.

        Raises
        ------
        ThumperError
            The board did not confirm within 2 s. It still stops by itself if no other host drives it.
        """
        deadline_s = self.now_s() + STOP_TIMEOUT_S
        stopped = False
        while not stopped and self.now_s() < deadline_s:
            self._port.discard_output()
            self._send(CommandRequest(command=Command.E_STOP))
            known = len(self._samples)
            self._receive_for(STOP_REPEAT_S)
            stopped = any(sample.telemetry.state is State.FAULT for sample in list(self._samples)[known:])
        if not stopped:
            raise ThumperError("the board did not confirm the emergency stop; cut its power if it moves")

    def set_parameter(self, name: str, value: float) -> None:
        """Set a parameter, in the unit that the protocol lists. The board checks the range, too."""
        spec = parameter_named(name)
        what = f"parameter {name} = {value:g} (allowed {spec.minimum:g}...{spec.maximum:g} {spec.unit})"
        try:
            self._request_ack(SetParameter(index=spec.index, value=round(value * spec.scale)), what)
        except (struct.error, OverflowError, ValueError):  # NaN, or too large for the wire format
            raise ThumperError(f"refused {what}: {REFUSAL_REASONS[AckStatus.OUT_OF_RANGE]}") from None

    def get_parameter(self, name: str) -> float:
        """Return a parameter's current value, in the unit that `docs/reference/protocol.md` lists."""
        spec = parameter_named(name)
        for _ in range(REQUEST_TRIES):
            reply, _ = self._request(GetParameter(index=spec.index), ParameterValue)
            if isinstance(reply, ParameterValue) and reply.index == spec.index:
                return reply.value / spec.scale
        raise ThumperError(f"the board did not report its parameter {name}; is the cable loose?")

    def round_trip_s(self, number: int, timeout_s: float) -> float | None:
        """Request one parameter; return how long [s] the reply took, or None if none came in time.

        `number` counts the requests. Each one asks for a different parameter than those before it, so that a
        late reply is not mistaken for the reply to the next request.
        """
        index = PARAMETERS[number % len(PARAMETERS)].index
        self._replies.clear()
        sent_s = self.now_s()
        self._send(GetParameter(index=index))
        while (left_s := sent_s + timeout_s - self.now_s()) > 0.0:
            self._receive(left_s)
            if any(isinstance(reply, ParameterValue) and reply.index == index for reply in self._replies):
                return self.now_s() - sent_s
        return None

    def close(self) -> bool:
        """Stop and disarm the motors, then close the port; return whether the board confirmed it.

        Never raises: the board also times out.
        """
        try:
            self.set_wheel_speeds(WheelSpeeds())
            self.command(Command.DISARM)
            return True
        except ThumperError:
            return False
        finally:
            self._port.close()

    def _handshake(self) -> Generator[None, None, None]:
        """Ask until the board identifies itself; yields after each unanswered request."""
        deadline_s = self.now_s() + BOOT_TIMEOUT_S
        received_bytes = 0
        while self.now_s() < deadline_s:
            reply, received = self._request(Identify(), Identity)
            received_bytes += received
            if self._schema_hash not in (None, SCHEMA_HASH):
                fix = "flash the firmware of this program's version"
                if self._port.url.startswith("sim://"):
                    fix = "build the simulated board's again: `make firmware`"
                raise ThumperError(
                    f"the firmware on {self._port.url} speaks another protocol version "
                    f"({self._schema_hash:08x}, this program {SCHEMA_HASH:08x}); {fix}",
                    exit_code=EXIT_NOT_THERE,
                )
            if isinstance(reply, Identity):
                self._identity = reply
                return
            yield
        foreign = f"the data at {self._port.baud} baud is not the Thumper protocol"
        reason = foreign if received_bytes else "it sends nothing"
        raise ThumperError(
            f"no Thumper board answers on {self._port.url}: {reason}; "
            "are port and baud rate right, is the board flashed and powered?",
            exit_code=EXIT_NOT_THERE,
        )

    def _request_ack(self, request: Message, what: str) -> None:
        """Send a request until it is acknowledged; `what` names it in error messages."""
        refusal = ""
        for _ in range(REQUEST_TRIES):
            reply, _ = self._request(request, Ack)
            if isinstance(reply, Ack):
                if reply.status is AckStatus.OK:
                    return
                refusal = REFUSAL_REASONS[reply.status]
                if reply.status is not AckStatus.BATTERY_UNKNOWN:
                    break
                self._receive_for(BATTERY_RETRY_S)
        if refusal:
            raise ThumperError(f"the board refused the {what}: {refusal}")
        raise ThumperError(f"the board did not answer the {what}; is the cable loose?")

    def _request(self, request: Message, reply_type: type[Message]) -> tuple[Message | None, int]:
        """Send once and wait; return the reply to this request, and the number of bytes received."""
        sequence = self._send(request)
        self._replies.clear()
        received = 0
        deadline_s = self.now_s() + REPLY_TIMEOUT_S
        while self.now_s() < deadline_s:
            received += self._receive(deadline_s - self.now_s())
            for reply in self._replies:
                if isinstance(reply, Ack):
                    if (reply.request_id, reply.request_seq) == (request.ID, sequence):
                        return reply, received
                elif isinstance(reply, reply_type):
                    return reply, received
        return None, received

    def _receive_for(self, duration_s: float) -> None:
        """Receive for `duration_s`; the telemetry stays queued for `poll`."""
        deadline_s = self.now_s() + duration_s
        while (left_s := deadline_s - self.now_s()) > 0.0:
            self._receive(left_s)

    def _send(self, message: Message, *, copies: int = 1) -> int:
        """Send `copies` of one frame and return its sequence number."""
        self._sequence = (self._sequence + 1) % 256
        # The leading delimiter ends a frame that noise has begun, so a damaged delimiter costs one frame.
        data = DELIMITER + encode_frame(message.ID, self._sequence, message.pack())
        self._port.write(copies * data)
        return self._sequence

    def _receive(self, timeout_s: float) -> int:
        """Read what has arrived, or wait for the first byte; dispatch frames. Returns the bytes read."""
        data = self._port.read_available(timeout_s)
        received_s = self.now_s()
        for frame in self._decoder.feed(data):
            self._dispatch(frame, received_s)
        return len(data)

    def _dispatch(self, frame: Frame, received_s: float) -> None:
        """Queue a message as telemetry or as a reply."""
        if frame.message_id == Identity.ID:  # its first field is the schema hash in every version
            self._schema_hash = int.from_bytes(frame.payload[:4], "little")
        message_type = MESSAGES.get(frame.message_id)
        if message_type is None:
            return
        try:
            message = message_type.unpack(frame.payload)
        except ValueError:  # another protocol version, which the handshake reports
            return
        if isinstance(message, Telemetry):
            last_us, self._last_time_us = self._last_time_us, message.time_us
            self.restarted |= last_us is not None and (message.time_us - last_us) % 2**32 > 2**31
            if self.restarted:
                return
            time_s = self._clock_filter.host_time_s(message.time_us, received_s)
            increment_rad = self._gyro_increments.add(message)
            sample = TelemetrySample(time_s=time_s, telemetry=message, gyro_increment_rad=increment_rad)
            self._samples.append(sample)
        else:
            self._replies.append(message)


def _int16(value: float) -> int:
    return max(-32768, min(32767, round(value)))
