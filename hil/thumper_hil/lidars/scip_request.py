"""Parse requests to a URG-04LX: MDsssseeeeccinn, MS, GDsssseeeecc, GS (Hokuyo C-42-03320B)."""

import re
from dataclasses import dataclass
from typing import Self

LAST_MEASURABLE_STEP = 768
MAX_REMARK_CHARS = 16


@dataclass(frozen=True, slots=True, kw_only=True)
class FixedSetting:
    """A setting that this model cannot change: its digits and the status for each value."""

    digits: int
    status: dict[int, bytes]
    other: bytes  # the status for all other values


FIXED_SETTINGS = {
    # Motor speed: 0 and 99 are the fixed speed, 1...10 are not available.
    b"CR": FixedSetting(
        digits=2, status={0: b"03", 99: b"03"} | dict.fromkeys(range(1, 11), b"04"), other=b"02"
    ),
    # Sensitivity: 1 is already set.
    b"HS": FixedSetting(digits=1, status={0: b"02", 1: b"03"}, other=b"01"),
    # Simulated faults: 10 ends one, but none is active; 1...5 are not available.
    b"DB": FixedSetting(digits=2, status={10: b"03"} | dict.fromkeys(range(1, 6), b"04"), other=b"01"),
}


class ScipRefusedError(ValueError):
    """A request that the lidar answers with a status other than 00; the message is that status."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasureRequest:
    """A request for scans: steps first..last, in clusters of `cluster`, `count` scans (0: endless)."""

    command: bytes
    remark: bytes  # with its semicolon
    first_step: int
    last_step: int
    cluster: int
    skip: int = 0
    count: int = 1

    @property
    def streams(self) -> bool:
        """True for MD and MS, which request future scans and not the latest one."""
        return self.command[:1] == b"M"

    @property
    def chars(self) -> int:
        """Number of characters per value: 3 for MD and GD, 2 for MS and GS."""
        return 3 if self.command[1:] == b"D" else 2

    def echo(self, remaining: int) -> bytes:
        """Return the first line of a reply; in a stream it includes the number of remaining scans."""
        text = b"%s%04d%04d%02d" % (self.command, self.first_step, self.last_step, self.cluster)
        if self.streams:
            text += b"%d%02d" % (self.skip, remaining)
        return text + self.remark

    @classmethod
    def parse(cls, command: bytes, parameters: bytes, remark: bytes) -> Self:
        """Parse the parameters.

        Raises
        ------
        ScipRefusedError
            The parameters are invalid; the message is the status to answer.
        """
        widths = (4, 4, 2, 1, 2) if command[:1] == b"M" else (4, 4, 2)
        if len(parameters) < sum(widths):
            raise ScipRefusedError("0C")
        if len(parameters) > sum(widths):
            raise ScipRefusedError("0E")
        fields, start = [], 0
        for width, status in zip(widths, ("01", "02", "03", "06", "07"), strict=False):
            text = parameters[start : start + width]
            if not text.isdigit():
                raise ScipRefusedError(status)
            fields.append(int(text))
            start += width
        first_step, last_step, cluster, *rest = fields
        if last_step > LAST_MEASURABLE_STEP:
            raise ScipRefusedError("04")
        if last_step < first_step:
            raise ScipRefusedError("05")
        skip, count = rest or (0, 1)
        return cls(
            command=command,
            remark=remark,
            first_step=first_step,
            last_step=last_step,
            cluster=cluster,
            skip=skip,
            count=count,
        )


def split_line(line: bytes) -> tuple[bytes, bytes, bytes]:
    """Return (command, parameters, remark with its semicolon) of a request without its line end.

    Raises
    ------
    ScipRefusedError
        0D for an unknown command, 0G or 0H for an invalid remark.
    """
    body, semicolon, remark = line.partition(b";")
    if not re.fullmatch(rb"[A-Z%]{2}[ -~]*", body):
        raise ScipRefusedError("0D")
    if len(remark) > MAX_REMARK_CHARS:
        raise ScipRefusedError("0G")
    if not re.fullmatch(rb"[A-Za-z0-9 ._+@]*", remark):
        raise ScipRefusedError("0H")
    return body[:2], body[2:], semicolon + remark


def fixed_setting_status(command: bytes, parameters: bytes) -> bytes:
    """Return the status for CR, HS and DB: already set to this value, or not available on this model."""
    setting = FIXED_SETTINGS[command]
    if len(parameters) < setting.digits:
        return b"0C"
    if len(parameters) > setting.digits:
        return b"0E"
    if not parameters.isdigit():
        return b"01"
    return setting.status.get(int(parameters), setting.other)
