"""Frames against an independent COBS and CRC, and with every kind of line noise."""

import ctypes

from cobs import cobs
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.firmware.core.host_interface import crc

payloads = st.one_of(st.binary(max_size=60), st.lists(st.sampled_from([0, 1, 255]), max_size=60).map(bytes))


def frame(body: bytes) -> bytes:
    return bytes(cobs.encode(body + crc(body).to_bytes(2, "little"))) + b"\0"


def push(core: ctypes.CDLL, decoder: int, data: bytes) -> list[bytes]:
    """Feed bytes; return id, seq and payload of each decoded frame."""
    found = []
    out = ctypes.create_string_buffer(80)
    for byte in data:
        if core.decoder_push(decoder, byte):
            size = core.decoder_frame(decoder, out)
            found.append(out.raw[:size])
    return found


def test_crc_check_value(core: ctypes.CDLL) -> None:
    """Check values of the CRC catalogue: CRC-16/MCRF4XX, and its complement X-25 that a frame carries."""
    assert core.crc16(b"123456789", 9) == 0x6F91
    assert crc(b"123456789") == 0x906E


@settings(max_examples=200, deadline=None)
@given(payload=payloads, seq=st.integers(0, 255))
def test_round_trip_with_an_independent_encoder(core: ctypes.CDLL, payload: bytes, seq: int) -> None:
    body = bytes([0x42, seq]) + payload
    out = ctypes.create_string_buffer(80)
    spare = ctypes.create_string_buffer(body + b"\0\0", len(body) + 2)
    size = core.frame_encode(spare, len(body) + 2, out)
    assert out.raw[:size] == frame(body)

    decoder = core.decoder_new()
    assert push(core, decoder, frame(body)) == [body]
    assert core.decoder_errors(decoder) == 0


@settings(max_examples=200, deadline=None)
@given(payload=payloads, cut=st.integers(0, 70))
def test_a_truncated_frame_is_rejected_and_the_next_one_read(
    core: ctypes.CDLL, payload: bytes, cut: int
) -> None:
    body = b"\x01\x02" + payload
    whole = frame(body)
    kept = whole[:-1][:cut]
    decoder = core.decoder_new()
    expected = [body, body] if kept == whole[:-1] else [body]
    assert push(core, decoder, kept + b"\0" + whole) == expected
    assert core.decoder_errors(decoder) == int(0 < len(kept) < len(whole) - 1)


@settings(max_examples=200, deadline=None)
@given(payload=payloads, bit=st.integers(0, 8 * 70))
def test_every_single_bit_flip_is_refused(core: ctypes.CDLL, payload: bytes, bit: int) -> None:
    """No wrong frame comes out, and the stream recovers by the second frame after the next delimiter."""
    body = b"\x01\x02" + payload
    corrupt = bytearray(frame(body))
    corrupt[bit // 8 % len(corrupt)] ^= 1 << bit % 8
    decoder = core.decoder_new()
    found = push(core, decoder, bytes(corrupt) + frame(b"\x03\x04") + frame(b"\x05\x06"))
    assert found in ([b"\x03\x04", b"\x05\x06"], [b"\x05\x06"])
    assert core.decoder_errors(decoder) >= 1


@settings(max_examples=200, deadline=None)
@given(noise=st.binary(max_size=600))
def test_any_bytes_leave_the_decoder_ready(core: ctypes.CDLL, noise: bytes) -> None:
    decoder = core.decoder_new()
    push(core, decoder, noise)
    assert push(core, decoder, b"\0" + frame(b"\x07\x08data")) == [b"\x07\x08data"]


def test_an_overlong_frame_is_rejected(core: ctypes.CDLL) -> None:
    decoder = core.decoder_new()
    assert push(core, decoder, frame(bytes(range(2, 100))) + frame(b"\x01\x02")) == [b"\x01\x02"]
    assert core.decoder_errors(decoder) == 1


def test_a_valid_frame_with_trailing_bytes_is_rejected(core: ctypes.CDLL) -> None:
    """Excess bytes are not just cut off."""
    body = bytes(range(1, 63))
    longer = body + crc(body).to_bytes(2, "little") + b"\x01"
    assert push(core, core.decoder_new(), bytes(cobs.encode(longer)) + b"\0") == []


def test_the_longest_frame_fits_and_one_byte_more_does_not(core: ctypes.CDLL) -> None:
    """The decoder of the host build accepts payloads of 60 bytes."""
    decoder = core.decoder_new()
    longest, longer = bytes(range(1, 63)), bytes(range(1, 64))
    assert push(core, decoder, frame(longest)) == [longest]
    assert push(core, decoder, frame(longer) + frame(longest)) == [longest]
    assert core.decoder_errors(decoder) == 1
