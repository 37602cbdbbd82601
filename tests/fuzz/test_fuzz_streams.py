"""No bytes from a camera or GPS receiver make its driver fail: it counts what is damaged, and reads on."""

import importlib.util
import os
import random
import re
import time
import tty
from collections.abc import Iterator
from contextlib import closing, suppress

import numpy as np
import pytest
from pynmeagps import calc_checksum  # type: ignore[import-untyped]

from tests.fuzz.corpus import kept, kept_if_it_fails
from tests.fuzz.mutate import mutated
from tests.fuzz.test_fuzz_readers import CASES, SECONDS
from thumper.camera.frame import MAX_PIXELS
from thumper.camera.mjpeg import MAX_BYTES, MjpegDriver
from thumper.camera.options import CameraOptions
from thumper.camera.tag_tracker import TagTracker
from thumper.common.geometry import Pose2
from thumper.common.serial_port import open_port
from thumper.gps.driver import GpsDriver
from thumper.gps.earth_reference import EarthReference, MapDatum
from thumper.gps.fix import FixStatus
from thumper.gps.options import GpsOptions

PIECE = 2000  # bytes that a pseudo-terminal holds


def nmea(text: str) -> bytes:
    return f"${text}*{calc_checksum(text)}\r\n".encode()


EPOCHS = 8
GPS = b"".join(
    nmea(f"GNGGA,0927{second:02d}.00,4717.{11399 + 60 * second},N,00833.91590,E,4,12,0.6,499.6,M,48.0,M,1,0")
    + nmea(f"GNGST,0927{second:02d}.00,0.9,,,,0.014,0.012,0.02")
    + nmea("GNRMC,,V,,,,,,,,,,N")
    for second in range(EPOCHS)
)


HEADER = b"--frame\r\nContent-Type: image/jpeg\r\nContent-Length: %d\r\nX-Timestamp: %d.5\r\n\r\n"


def with_valid_checksums(stream: bytes) -> bytes:
    """Return the stream with the checksum of each sentence, so that its fields are read, too."""

    def checked(match: re.Match[bytes]) -> bytes:
        return b"$" + match[1] + b"*" + str(calc_checksum(match[1].decode("latin-1"))).encode()

    return re.sub(rb"\$([^*\n]*)\*..", checked, stream)


class Line:
    """A pseudo-terminal: what is sent at one end arrives at the port."""

    def __init__(self) -> None:
        self._end, device = os.openpty()
        tty.setraw(device)
        self.port = open_port(os.ttyname(device), baud=115_200, name="sensor")
        os.close(device)

    def send(self, stream: bytes) -> Iterator[None]:
        """Send the stream in pieces; read after each."""
        for start in range(0, len(stream), PIECE):
            sent = os.write(self._end, stream[start : start + PIECE])
            while self.port.raw.in_waiting < sent:
                time.sleep(0)
            yield

    def close(self) -> None:
        self.port.close()
        os.close(self._end)


@pytest.fixture
def line() -> Iterator[Line]:
    with closing(Line()) as line:
        yield line


def cases(name: str, content: bytes) -> Iterator[bytes]:
    """Yield the kept inputs, then changed ones."""
    yield from kept(name)
    rng, end_s = random.Random(time.time_ns() if SECONDS else 1), time.monotonic() + SECONDS
    case = 0
    while case < CASES or time.monotonic() < end_s:
        case += 1
        changed = mutated(content, rng)
        yield with_valid_checksums(changed) if name == "gps" and rng.random() < 0.8 else changed


def test_gps(line: Line) -> None:
    next(line.send(GPS))
    driver = GpsDriver(line.port, latency_s=0.1)
    for stream in cases("gps", GPS):
        earths = [EarthReference(GpsOptions(), datum) for datum in (None, MapDatum(47.28, 8.56, 0.3))]
        odom_from_base = Pose2()
        with kept_if_it_fails("gps", stream):
            for _ in line.send(stream):
                for fix in driver.poll():
                    is_possible = abs(fix.latitude_deg) <= 90.0 and abs(fix.longitude_deg) <= 180.0
                    assert is_possible == (fix.status is not FixStatus.NONE)
                    odom_from_base @= Pose2(x_m=1.0)
                    for earth in earths:
                        earth.filter.predict(odom_from_base, 0.0)
                        earth.add(fix, odom_from_base, Pose2(), drift_m=0.0)
                        earth.prior(fix), earth.in_map(fix)
                        earth.map_from_odom(better_than_m=1.0)
            fixes = [fix for _ in line.send(b"\n" + GPS) for fix in driver.poll()]
            assert len(fixes) >= EPOCHS


@pytest.mark.skipif(importlib.util.find_spec("cv2") is None, reason="the extra `camera` is not installed")
def test_camera(line: Line) -> None:
    import cv2

    noise = np.random.default_rng(0).integers(0, 255, (3, 24, 32), np.uint8)
    jpegs = [cv2.imencode(".jpg", image)[1].tobytes() for image in noise]
    content = b"".join(HEADER % (len(jpeg), k) + jpeg + b"\r\n" for k, jpeg in enumerate(jpegs))
    next(line.send(content))
    driver = MjpegDriver(line.port, latency_s=0.0)
    tracker = TagTracker(0, 0.1, CameraOptions(width_px=32, height_px=24))
    for stream in cases("camera", content):
        with kept_if_it_fails("camera", stream):
            for _ in line.send(stream):
                for frame in driver.poll():
                    tracker.add(frame, Pose2())
                    with suppress(ValueError):
                        assert 0 < frame.grey().size <= MAX_PIXELS
    # A damaged length may claim the frames that follow.
    missed = MAX_BYTES // len(content)
    assert any(driver.poll() for _ in range(missed + 2) for _ in line.send(content))
