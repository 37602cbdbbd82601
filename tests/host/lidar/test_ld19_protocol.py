"""LD19 frames: the manufacturer's example, and damaged streams."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from thumper.lidar.ld19_protocol import FRAME_BYTES, Ld19Decoder, crc8

PUBLISHED = bytes.fromhex(
    "542C6808AB7EE000E4DC00E2D900E5D500E3D300E4D000E9CD00E4CA00E2C700E9C500E5C200E5C000E5BE823A1A50"
)


def test_the_published_frame() -> None:
    (frame,) = Ld19Decoder().feed(PUBLISHED)
    assert (frame.speed_deg_s, frame.stamp_ms) == (2152, 6714)
    assert frame.start_deg == pytest.approx(324.27)
    assert frame.step_deg == pytest.approx((334.70 - 324.27) / 11)
    assert frame.ranges_mm.tolist() == [224, 220, 217, 213, 211, 208, 205, 202, 199, 197, 194, 192]
    assert frame.intensities[:3].tolist() == [228, 226, 229]


@given(noise=st.binary(max_size=60), cuts=st.lists(st.integers(1, 30), max_size=30))
def test_frames_are_found_in_any_stream(noise: bytes, cuts: list[int]) -> None:
    decoder, frames = Ld19Decoder(), []
    stream = noise + 3 * PUBLISHED
    for cut in cuts:
        frames += decoder.feed(stream[:cut])
        stream = stream[cut:]
    frames += decoder.feed(stream)
    assert len(frames) == 3


@given(data=st.data())
def test_one_changed_byte_costs_one_frame(data: st.DataObject) -> None:
    at = data.draw(st.integers(0, FRAME_BYTES - 1))
    changed = bytearray(PUBLISHED)
    changed[at] ^= data.draw(st.integers(1, 255))
    decoder = Ld19Decoder()
    assert len(decoder.feed(bytes(changed) + 2 * PUBLISHED)) == 2
    assert decoder.bad_frames == (1 if at > 1 else 0), "a damaged header is no bad frame"


def test_the_last_byte_before_a_header_is_kept() -> None:
    decoder = Ld19Decoder()
    assert decoder.feed(b"\x00" + PUBLISHED[:1]) == []
    assert len(decoder.feed(PUBLISHED[1:])) == 1


def test_a_frame_with_impossible_angles_is_bad() -> None:
    body = bytearray(PUBLISHED[:-1])
    body[42:44] = body[4:6]  # ends where it starts
    decoder = Ld19Decoder()
    assert decoder.feed(bytes(body) + bytes([crc8(bytes(body))])) == []
    assert decoder.bad_frames == 1


@given(st.lists(st.binary(max_size=200), max_size=8))
def test_no_bytes_crash_the_decoder_or_fill_memory(chunks: list[bytes]) -> None:
    decoder = Ld19Decoder()
    for chunk in chunks:
        decoder.feed(chunk)
    assert len(decoder._buffer) < FRAME_BYTES
