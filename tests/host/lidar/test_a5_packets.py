"""Test requests, replies and packets of RPLIDAR and YDLIDAR with bytes that others captured."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thumper.lidar.a5_protocol import DeviceInfo, find_reply, request
from thumper.lidar.point_packet import PacketDecoder
from thumper.lidar.rplidar_packets import dense_decoder, express_decoder, legacy_decoder
from thumper.lidar.ydlidar_packets import YdlidarDecoder, angle_correction_deg

# From the sources of drivers on GitHub: what a real RPLIDAR A1M8 (firmware 1.29) and a YDLIDAR X4 answered.
A1_INFO = bytes.fromhex("a55a1400000004181d0107d98a99f6c9e59ad2c5e59cf725583412")
X4_INFO = bytes.fromhex("a55a1400000004060a0101020002000006020100000000020105" + "00")  # one byte was lost
HEALTH = bytes.fromhex("a55a0300000006000000")
A1_NODES = bytes.fromhex("0201000000 3eeda50000 3e97a64616")  # no echo, no echo, 1425.5 mm at 333.17 degrees
# A triangulating lidar of the X4's protocol: the packet that starts a turn, one of 40 points, a damaged one.
TURN_START = bytes.fromhex("aa55010199af99afab540000")
FORTY_POINTS = bytes.fromhex(
    "aa550028d9af1f053491000000000000000000000000000000000000000000000000dc2d000000001c7c187d047e347d307cf47a"
    "2c7a8879f8783478"
    "0c771076187548740000a84e8c4e184fbc4f000000007c39e4390000486c"
)
DAMAGED = bytes.fromhex(
    "aa5500225f054d0dac13dc6b4468006b506ac8695069846884674867cc666866dc6584654465bc645464c4638863f06224637c63"
    "2863a061" + 22 * "00"
)


def test_requests_are_those_of_the_documents() -> None:
    assert request(0x20).hex() == "a520"
    assert request(0x82, bytes(5)).hex() == "a58205000000000022"
    assert request(0x84, bytes.fromhex("710000000300")).hex() == "a58406710000000300" + "55"


@pytest.mark.parametrize(
    ("data", "model", "firmware", "hardware"), [(A1_INFO, 0x18, "1.29", 7), (X4_INFO, 6, "1.10", 1)]
)
def test_real_device_info(data: bytes, model: int, firmware: str, hardware: int) -> None:
    reply = find_reply(b"noise \xa5" + HEALTH + data, {0x04})
    assert reply is not None
    info = DeviceInfo.parse(reply[1])
    assert (info.model, info.firmware, info.hardware) == (model, firmware, hardware)
    assert find_reply(data[:-1], {0x04}) is None, "not complete yet"


def test_everything_after_the_descriptor_of_a_stream_belongs_to_it() -> None:
    assert find_reply(b"\xa5\x5a\x54\x00\x00\x40\x85abc", {0x81, 0x82, 0x85}) == (0x85, b"abc")
    assert find_reply(b"\xa5\x5a\x05\x00\x00\x40\x81", {0x85}) is None


def test_real_nodes_of_a_standard_scan() -> None:
    (packet,) = legacy_decoder().feed(6 * A1_NODES)
    angles_deg = (packet.start_deg + packet.step_deg * np.arange(16) + packet.turned_deg) % 360.0
    assert angles_deg[:3] == pytest.approx([0.0, 331.84375, 333.171875])
    assert list(packet.ranges_m[:3]) == [0.0, 0.0, 1.4255]


def test_nodes_that_look_right_in_mid_node_are_not_taken() -> None:
    """The bytes from 7 on pass all check bits as a node: 3968 mm at 1.28 degrees."""
    decoder = legacy_decoder()
    packets = decoder.feed((20 * A1_NODES)[6:])
    assert packets
    for packet in packets:
        assert set(packet.ranges_m) == {0.0, 1.4255}
    assert decoder.bad_packets == 1


def test_real_packets_of_a_ydlidar() -> None:
    decoder = YdlidarDecoder()
    start, forty = decoder.feed(b"\x54\x50\x00" + TURN_START + FORTY_POINTS + DAMAGED)
    assert start.ranges_m.size == 1
    assert (start.start_deg + 7.0) % 360.0 == pytest.approx(351.1875)
    assert (forty.start_deg + 7.0, forty.ranges_m.size) == (351.6875, 40)
    assert forty.step_deg == pytest.approx((360.0 + 10.234375 - 351.6875) / 39)
    assert forty.ranges_m[12:17] == pytest.approx([2.935, 0.0, 0.0, 7.943, 8.006])
    assert forty.turned_deg[12] - 7.0 == pytest.approx(angle_correction_deg(np.array([2.935]))[0])
    assert decoder.bad_packets >= 1


def test_angle_correction_of_the_manual() -> None:
    assert angle_correction_deg(np.array([1.0, 8.0, 0.0])) == pytest.approx([-6.7622, -7.8374, 0.0], abs=1e-3)


def test_capsules_carry_the_angle_of_the_one_before() -> None:
    """From the layout of LR001: cabins of 14 bits of range [mm] and 6 bits of lead [1/8 degree]."""
    decoder = express_decoder()
    cabins = 16 * bytes.fromhex("a20f 411f 3c")  # 1000 mm, lead 44 / 8; 2000 mm, 19 / 8
    capsules = [_capsule(angle_deg, cabins) for angle_deg in (350.0, 6.0, 22.0, 54.0)]
    assert decoder.feed(capsules[0]) == []
    (packet,) = decoder.feed(capsules[1])
    assert packet.step_deg == 0.5
    angles_deg = packet.start_deg + packet.step_deg * np.arange(32) + packet.turned_deg
    assert list(packet.ranges_m[:2]) == [1.0, 2.0]
    assert angles_deg[:2] == pytest.approx([350.0 - 44 / 8, 350.5 - 19 / 8])
    packets = decoder.feed(capsules[2] + capsules[3])
    assert [one.step_deg for one in packets] == [0.5, 0.5], "a capsule is missing before the last one"


def _capsule(angle_deg: float, content: bytes) -> bytes:
    content = round(64 * angle_deg).to_bytes(2, "little") + content
    check = 0
    for byte in content:
        check ^= byte
    return bytes((0xA0 | check & 0x0F, 0x50 | check >> 4)) + content


def test_dense_capsule() -> None:
    decoder = dense_decoder()
    ranges = np.arange(1000, 1040, dtype="<u2").tobytes()
    damaged = bytearray(_capsule(90.0, ranges))
    damaged[50] ^= 1
    (packet,) = decoder.feed(_capsule(10.0, ranges) + _capsule(38.0, ranges) + damaged)
    assert packet.step_deg == pytest.approx(0.7)
    assert not packet.turned_deg.any()
    assert packet.ranges_m == pytest.approx(np.arange(1.0, 1.0395, 0.001))
    assert decoder.bad_packets == 1


@pytest.mark.parametrize("make", [legacy_decoder, express_decoder, dense_decoder, YdlidarDecoder])
@given(parts=st.lists(st.binary(max_size=300), max_size=5))
def test_no_bytes_break_a_decoder(make: Callable[[], PacketDecoder], parts: list[bytes]) -> None:
    together, apart = make(), make()
    whole = together.feed(b"".join(parts))
    pieces = [packet for part in parts for packet in apart.feed(part)]
    assert len(whole) == len(pieces)
    assert together.bad_packets == apart.bad_packets
