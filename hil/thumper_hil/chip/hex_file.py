"""Read Intel HEX, the format of programmers and boot loaders."""

from pathlib import Path

from thumper.common.errors import ThumperError
from thumper.common.files import read_bytes

DATA, END_OF_FILE = 0, 1
EXTENDED_SEGMENT, EXTENDED_LINEAR = 2, 4
MAX_MB = 1.0


def read_hex(path: Path) -> tuple[int, bytes]:
    """Return the first address and all bytes from there; gaps are 0xFF, as in erased flash.

    Raises
    ------
    ThumperError
        The file cannot be read, a record is damaged, there is no data, or an address is above 64 KB.
    """
    try:
        lines = read_bytes(path, MAX_MB).decode("ascii").split()
    except (OSError, UnicodeDecodeError) as error:
        raise ThumperError(f"{path}: cannot be read as Intel HEX ({error})") from error
    chunks: dict[int, bytes] = {}
    for number, line in enumerate(lines, start=1):
        try:
            record = bytes.fromhex(line.removeprefix(":"))
        except ValueError:
            record = b""
        if line[:1] != ":" or len(record) < 5 or len(record) != record[0] + 5 or sum(record) % 256 != 0:
            raise ThumperError(f"{path}: line {number} is not valid Intel HEX; build the file again")
        kind, address, data = record[3], int.from_bytes(record[1:3], "big"), record[4:-1]
        if kind == DATA:
            chunks[address] = data
        elif kind == END_OF_FILE:
            break
        elif kind in (EXTENDED_SEGMENT, EXTENDED_LINEAR) and any(data):
            raise ThumperError(
                f"{path}: line {number} is above 64 KB, so the file is for another chip; build it again"
            )
    if not chunks:
        raise ThumperError(f"{path}: contains no data; build the file again")
    start = min(chunks)
    image = bytearray(b"\xff" * (max(address + len(data) for address, data in chunks.items()) - start))
    for address, data in chunks.items():
        image[address - start : address - start + len(data)] = data
    return start, bytes(image)
