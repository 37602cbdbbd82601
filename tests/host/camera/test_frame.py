"""Damaged and hostile images: refused by their header, before anything is decoded."""

import importlib.util
import struct

import numpy as np
import pytest

from thumper.camera.frame import MAX_SCANS, CameraFrame, jpeg_shape
from thumper.camera.mjpeg import MjpegDecoder

if importlib.util.find_spec("cv2") is None:
    pytest.skip("the extra `camera` is not installed", allow_module_level=True)

import cv2

IMAGE: bytes = cv2.imencode(".jpg", np.full((48, 64), 90, np.uint8))[1].tobytes()
SIZE_AT = IMAGE.index(b"\xff\xc0") + 5
SCAN_AT = IMAGE.index(b"\xff\xda")


def claiming(height: int, width: int) -> bytes:
    return IMAGE[:SIZE_AT] + struct.pack(">HH", height, width) + IMAGE[SIZE_AT + 4 :]


def test_an_image_has_the_size_of_its_header() -> None:
    assert jpeg_shape(IMAGE) == (48, 64)
    assert CameraFrame(time_s=0.0, jpeg=IMAGE).grey().shape == (48, 64)


def test_the_orientation_of_a_phone_turns_no_image() -> None:
    tags = b"MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0"  # Exif: turn by 90 degrees
    exif = b"\xff\xe1" + struct.pack(">H", len(tags) + 8) + b"Exif\0\0" + tags
    assert CameraFrame(time_s=0.0, jpeg=IMAGE[:2] + exif + IMAGE[2:]).grey().shape == (48, 64)


@pytest.mark.parametrize(
    "jpeg",
    [
        claiming(60000, 60000),
        claiming(30000, 30000),  # OpenCV would take 900 MB for it
        claiming(0, 64),
        IMAGE[:SCAN_AT] + 100_000 * IMAGE[SCAN_AT:-2],  # each scan is a pass over the image
        IMAGE[:SCAN_AT],
        IMAGE[SCAN_AT:],
        IMAGE[:2] + IMAGE[SCAN_AT:],
        IMAGE[:2] + b"\xff\x01" + IMAGE[2:],
        b"",
        b"\xff\xd8",
        b"\x89PNG\r\n\x1a\n" + bytes(50),
    ],
)
def test_a_hostile_header_is_refused_before_it_is_decoded(
    monkeypatch: pytest.MonkeyPatch, jpeg: bytes
) -> None:
    monkeypatch.setattr(cv2, "imdecode", lambda *_: pytest.fail("decoded"))
    with pytest.raises(ValueError, match="frame"):
        CameraFrame(time_s=0.0, jpeg=jpeg).grey()


def test_a_progressive_image_is_read() -> None:
    noise = np.random.default_rng(0).integers(0, 255, (48, 64, 3), np.uint8)
    jpeg = cv2.imencode(".jpg", noise, (cv2.IMWRITE_JPEG_PROGRESSIVE, 1))[1].tobytes()
    assert 1 < jpeg.count(b"\xff\xda") <= MAX_SCANS
    assert CameraFrame(time_s=0.0, jpeg=jpeg).grey().shape == (48, 64)


def part(image: bytes, length: str = "", stamp: str = "1.5") -> bytes:
    header = f"--frame\r\nContent-Type: image/jpeg\r\nContent-Length: {length or len(image)}\r\n"
    return f"{header}X-Timestamp: {stamp}\r\n\r\n".encode() + image + b"\r\n"


@pytest.mark.parametrize(
    "stream",
    [
        part(claiming(60000, 60000)),
        part(IMAGE, length="9" * 5000),
        part(IMAGE, stamp="1.2.3"),
        200_000 * b"-" + b"\r\n\r\n",
    ],
)
def test_a_damaged_image_of_a_stream_is_counted_and_the_next_one_read(stream: bytes) -> None:
    decoder = MjpegDecoder()
    assert len(list(decoder.feed(part(IMAGE)))) == 1
    assert list(decoder.feed(stream)) == []
    assert decoder.bad > 0
    assert len(list(decoder.feed(part(IMAGE)))) == 1
