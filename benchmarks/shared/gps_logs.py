"""Reads logs of GPS receivers and counts what the driver could not read.

Run: python benchmarks/shared/gps_logs.py FILE...      # such as the tests/*.log of semuconsulting/pynmeagps

Exit code 1 if a sentence or a frame was rejected.
"""

import argparse
import sys
from pathlib import Path

from thumper.gps.nmea import SentenceDecoder
from thumper.gps.ubx import NAV_PVT, UbxSplitter

CHUNK_BYTES = 64  # as they arrive from a port


def main() -> None:
    """Print a line for each file and their sum."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("files", type=Path, nargs="+", metavar="FILE")
    total = [0, 0, 0, 0, 0]
    for path in parser.parse_args().files:
        counts = count(path.read_bytes())
        total = [a + b for a, b in zip(total, counts, strict=True)]
        print(f"{path.name}: {text(counts)}")
    print(f"all: {text(total)}")
    sys.exit(total[1] + total[3] > 0)


def count(data: bytes) -> list[int]:
    """Return the sentences read and rejected, the frames read and rejected, and the positions among both."""
    nmea, ubx, positions = SentenceDecoder(), UbxSplitter(), 0
    for start in range(0, len(data), CHUNK_BYTES):
        frames, rest = ubx.feed(data[start : start + CHUNK_BYTES])
        positions += sum(frame.kind == NAV_PVT for frame in frames)
        positions += sum(message.msgID == "GGA" for message in nmea.feed(rest))
    return [nmea.good, nmea.bad, ubx.good, ubx.bad, positions]


def text(counts: list[int]) -> str:
    """Return the counts in one line."""
    return "{} sentences, {} rejected; {} UBX frames, {} rejected; {} positions".format(*counts)


if __name__ == "__main__":
    main()
