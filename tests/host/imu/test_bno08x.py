"""Decode UART-RVC frames: the data sheet's example, frames in pieces, damaged ones and arbitrary bytes."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from thumper.imu.bno08x import MG_M_S2, RvcDecoder

DATA_SHEET = bytes.fromhex("AAAADE010092FF25088DFEECFFD103000000E7")  # BNO08X data sheet, 1.3.5.2


def test_the_example_of_the_data_sheet() -> None:
    (frame,) = RvcDecoder().feed(DATA_SHEET)
    assert frame.index == 222
    angles = (frame.yaw_rad, frame.pitch_rad, frame.roll_rad)
    assert [math.degrees(angle) for angle in angles] == pytest.approx([0.01, -1.10, 20.85])
    assert [a / MG_M_S2 for a in frame.acceleration_m_s2] == pytest.approx([-371.0, -20.0, 977.0])


@given(st.lists(st.integers(1, 40), min_size=1, max_size=20))
def test_frames_in_pieces_are_the_same_frames(sizes: list[int]) -> None:
    decoder, data, frames = RvcDecoder(), 4 * DATA_SHEET, []
    for size in sizes:
        frames += decoder.feed(data[:size])
        data = data[size:]
    frames += decoder.feed(data)
    assert [frame.index for frame in frames] == [222] * 4
    assert decoder.bad_frames == 0


@given(st.integers(2, 18), st.integers(1, 255))
def test_a_damaged_frame_is_dropped_and_the_next_one_read(place: int, flip: int) -> None:
    decoder = RvcDecoder()
    damaged = bytearray(DATA_SHEET)
    damaged[place] ^= flip
    assert len(decoder.feed(bytes(damaged) + 2 * DATA_SHEET)) == 2
    assert decoder.bad_frames >= 1


@given(st.integers(2, 18))
def test_a_lost_byte_costs_its_own_frame_only(place: int) -> None:
    shorter = DATA_SHEET[:place] + DATA_SHEET[place + 1 :]
    assert len(RvcDecoder().feed(shorter + 2 * DATA_SHEET)) == 2


@given(st.binary(max_size=200))
def test_it_reads_on_after_arbitrary_bytes(noise: bytes) -> None:
    decoder = RvcDecoder()
    decoder.feed(noise)
    decoder.feed(DATA_SHEET)  # its start may complete a false frame
    assert decoder.feed(2 * DATA_SHEET)[-1].index == 222
