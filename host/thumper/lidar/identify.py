"""Find out which lidar is on a port, by asking as each of them is asked."""

from thumper.common.serial_port import SerialPort
from thumper.lidar import ld19, urg04lx
from thumper.lidar.a5_models import A5_MODELS, find_model, unknown_text
from thumper.lidar.a5_protocol import INFO_TYPE, DeviceInfo, find_reply
from thumper.lidar.ld19_protocol import Ld19Decoder

ANSWER_S = 0.4
QUIET_S = 0.05


def identify_lidar(port: SerialPort) -> tuple[str, str] | None:
    """Return option name and description of the lidar on `port`; None if none answers. Takes up to 5 s.

    The name is empty if it answers as a model that has no driver.

    Use it on a port that is meant for a lidar only: an adapter's USB id is the same on a motor board.

    Raises
    ------
    PortError
        The port failed.
    """
    for model in A5_MODELS.values():
        port.set_baud(model.baud)
        port.write(model.stop)
        _read(port, QUIET_S)
        port.write(model.info)
        reply = find_reply(_read(port, ANSWER_S), {INFO_TYPE})
        if reply is not None:
            info = DeviceInfo.parse(reply[1])
            found = find_model(info, model)
            return (
                (found[0], f"{found[1].name}, firmware {info.firmware}")
                if found
                else ("", unknown_text(info))
            )
    port.set_baud(ld19.BAUD)
    if Ld19Decoder().feed(_read(port, ANSWER_S)):
        return "ld19", "LD19 (LD06)"
    port.set_baud(urg04lx.BAUD)
    port.write(b"QT\nVV\n")
    if b"PROT:SCIP" in _read(port, ANSWER_S):
        return "urg04lx", "URG-04LX (SCIP 2.0)"
    return None


def _read(port: SerialPort, seconds: float) -> bytes:
    data = b""
    until_s = port.now_s() + seconds
    while port.now_s() < until_s:
        data += port.read_available(0.02)
    return data
