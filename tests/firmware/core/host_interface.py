"""The core's HostInterface in the host build, driven with the generated Python codec."""

import ctypes

from cobs import cobs

from thumper.board import messages as m


def crc(data: bytes, start: int = 0xFFFF) -> int:
    """Return the CRC-16/X-25, computed one bit at a time."""
    value = start
    for byte in data:
        value ^= byte
        for _ in range(8):
            value = (value >> 1) ^ 0x8408 if value & 1 else value >> 1
    return value ^ 0xFFFF


def frame(message_id: int, payload: bytes, seq: int = 5) -> bytes:
    """Return a frame with its delimiter."""
    body = bytes([message_id, seq]) + payload
    return bytes(cobs.encode(body + crc(body).to_bytes(2, "little"))) + b"\0"


def read_frames(data: bytes) -> list[tuple[int, m.Message]]:
    """Return sequence number and message of each frame; fail on a wrong CRC."""
    bodies = [cobs.decode(part) for part in data.split(b"\0")[:-1]]
    assert all(crc(body[:-2]).to_bytes(2, "little") == body[-2:] for body in bodies)
    return [(body[1], m.MESSAGES[body[0]].unpack(body[2:-2])) for body in bodies]


class HostInterface:
    """The HostInterface after one start, with a reset cause and an EEPROM (a new one by default).

    Its battery has one reading, unless `battery_mV` is 0.
    """

    def __init__(
        self,
        core: ctypes.CDLL,
        cause: m.ResetCause = m.ResetCause.POWER_ON,
        eeprom: int | None = None,
        latched: m.Fault = m.Fault.NONE,
        battery_mV: int = 7400,
    ) -> None:
        self.core = core
        self.handle = core.host_new(cause, latched, core.eeprom_new() if eeprom is None else eeprom)
        if battery_mV != 0:
            core.host_battery(self.handle, battery_mV)

    def feed(self, data: bytes) -> list[tuple[int, m.Message]]:
        """Return sequence number and message of each answer."""
        out = ctypes.create_string_buffer(30 * len(data) + 30)
        size = self.core.host_receive(self.handle, data, len(data), out)
        return read_frames(out.raw[:size])

    def send(self, message: m.Message, seq: int = 5) -> list[m.Message]:
        """Return the answers to a request; each must have the request's sequence number."""
        answers = self.feed(frame(message.ID, message.pack(), seq))
        assert all(answered == seq for answered, _ in answers)
        return [answer for _, answer in answers]

    def command(self, command: m.Command) -> m.AckStatus:
        """Return the answer to a command that is answered immediately."""
        (ack,) = self.send(m.CommandRequest(command=command))
        assert isinstance(ack, m.Ack)
        assert (ack.request_id, ack.request_seq) == (m.CommandRequest.ID, 5)
        return ack.status

    def work(self, passes: int = 500) -> list[tuple[int, m.Message]]:
        """Run passes of the main loop's save and load work; return the answers."""
        answers = []
        out = ctypes.create_string_buffer(100)
        for _ in range(passes):
            size = self.core.host_step_store(self.handle, out)
            answers += read_frames(out.raw[:size])
        return answers

    def command_later(self, command: m.Command, seq: int = 5) -> m.AckStatus:
        """Return the answer to a command that is answered later (SAVE, LOAD)."""
        assert self.send(m.CommandRequest(command=command), seq) == []
        ((answered, ack),) = self.work()
        assert isinstance(ack, m.Ack)
        assert (answered, ack.request_id, ack.request_seq) == (seq, m.CommandRequest.ID, seq)
        return ack.status

    def get(self, name: str) -> int:
        """Return a parameter's wire value."""
        index = next(spec.index for spec in m.PARAMETERS if spec.name == name)
        (answer,) = self.send(m.GetParameter(index=index))
        assert isinstance(answer, m.ParameterValue)
        assert answer.index == index
        return answer.value

    def set(self, name: str, value: int) -> m.AckStatus:
        """Set a parameter's wire value; return the status."""
        index = next(spec.index for spec in m.PARAMETERS if spec.name == name)
        (answer,) = self.send(m.SetParameter(index=index, value=value))
        assert isinstance(answer, m.Ack)
        return answer.status

    def wait(self, milliseconds: int) -> None:
        """Advance the time."""
        for _ in range(milliseconds):
            self.core.host_advance_time(self.handle, 1)

    def telemetry(self) -> m.Telemetry:
        """Return the current telemetry."""
        out = ctypes.create_string_buffer(100)
        size = self.core.host_telemetry(self.handle, out)
        ((_, message),) = read_frames(out.raw[:size])
        assert isinstance(message, m.Telemetry)
        return message

    def status(self) -> tuple[m.State, m.Fault, int, int]:
        """Return state, fault and the motors' command values."""
        out = (ctypes.c_int * 5)()
        self.core.host_status(self.handle, out)
        assert out[0] == out[2], "the motors must follow the supervisor's state"
        return m.State(out[0]), m.Fault(out[1]), out[3], out[4]
