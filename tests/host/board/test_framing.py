"""Frames on the wire: known vectors, round trips and noise."""

from hypothesis import given
from hypothesis import strategies as st

from thumper.board.framing import MAX_ENCODED_BYTES, Frame, FrameDecoder, crc16, encode_frame

payloads = st.binary(max_size=60)
bytes_8 = st.integers(0, 255)


def test_the_crc_matches_the_catalogue() -> None:
    """CRC-16/X-25 of "123456789" is 0x906E in the CRC catalogue."""
    assert crc16(b"123456789") == 0x906E


@given(message_id=bytes_8, sequence=bytes_8, payload=payloads)
def test_round_trip(message_id: int, sequence: int, payload: bytes) -> None:
    encoded = encode_frame(message_id, sequence, payload)
    assert encoded.count(b"\x00") == 1
    assert FrameDecoder().feed(encoded) == [Frame(message_id=message_id, sequence=sequence, payload=payload)]


@given(payload=payloads, cuts=st.lists(st.integers(0, 200), max_size=5))
def test_frames_do_not_depend_on_the_chunks_of_the_stream(payload: bytes, cuts: list[int]) -> None:
    stream = encode_frame(1, 2, payload) * 2
    decoder, frames, start = FrameDecoder(), [], 0
    for cut in [*sorted(cuts), len(stream)]:
        frames += decoder.feed(stream[start:cut])
        start = max(start, min(cut, len(stream)))
    assert [frame.payload for frame in frames] == [payload, payload]
    assert decoder.errors == 0


@given(payload=payloads, position=st.integers(0, 300), flip=st.integers(1, 255))
def test_a_damaged_frame_is_dropped_and_the_next_one_arrives(
    payload: bytes, position: int, flip: int
) -> None:
    good = encode_frame(0x82, 7, payload)
    damaged = bytearray(good)
    damaged[position % len(good)] ^= flip
    decoder = FrameDecoder()
    frames = decoder.feed(bytes(damaged)) + decoder.feed(b"\x00" + good)
    assert frames[-1].payload == payload
    assert all(frame.payload == payload and frame.message_id == 0x82 for frame in frames)
    assert len(frames) == 1
    assert decoder.errors >= 1


@given(payload=payloads, cut=st.integers(1, 64))
def test_a_truncated_frame_is_dropped(payload: bytes, cut: int) -> None:
    whole = encode_frame(0x82, 7, payload)[:-1]
    decoder = FrameDecoder()
    assert decoder.feed(whole[: -min(cut, len(whole))] + b"\x00") == []


def test_endless_noise_without_a_delimiter_is_dropped() -> None:
    decoder = FrameDecoder()
    assert decoder.feed(b"\x55" * (10 * MAX_ENCODED_BYTES)) == []
    assert decoder.errors >= 1
    assert decoder.feed(b"\x00" + encode_frame(1, 1, b"ok"))[0].payload == b"ok"
