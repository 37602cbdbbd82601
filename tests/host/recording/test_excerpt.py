"""Parts of a recording are the messages that the MCAP library reads, also if chunks overlap."""

import random
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from thumper.recording.excerpt import open_excerpts

TOPICS = ("pose", "scan", "map")
COMPRESSIONS = (CompressionType.ZSTD, CompressionType.LZ4, CompressionType.NONE)


def write(path: Path, times_ns: list[tuple[int, str]], compression: CompressionType) -> None:
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=200, compression=compression)
        writer.start()
        schema = writer.register_schema("std_msgs/msg/Empty", "ros2msg", b"")
        channels = {
            topic: writer.register_channel(topic=f"/{topic}", message_encoding="cdr", schema_id=schema)
            for topic in TOPICS
        }
        for number, (time_ns, topic) in enumerate(times_ns):
            writer.add_message(channels[topic], time_ns, number.to_bytes(4, "little"), time_ns)
        writer.finish()


def expected(path: Path, **options: object) -> list[tuple[int, str]]:
    with path.open("rb") as stream:
        found = make_reader(stream).iter_messages(**options)  # type: ignore[arg-type]
        return [(message.log_time, channel.topic[1:]) for _, channel, message in found]


@settings(max_examples=50)
@given(
    seed=st.integers(0, 10**6),
    wanted=st.sets(st.sampled_from(TOPICS), min_size=1),
    start_ns=st.integers(0, 1000),
    length_ns=st.integers(0, 500),
)
def test_a_part_is_what_the_library_reads(
    tmp_path_factory: pytest.TempPathFactory, seed: int, wanted: set[str], start_ns: int, length_ns: int
) -> None:
    rng, path = random.Random(seed), tmp_path_factory.mktemp("part") / "a.mcap"
    times_ns = [(rng.randrange(1000), rng.choice(TOPICS)) for _ in range(rng.randint(1, 60))]
    write(path, times_ns, rng.choice(COMPRESSIONS))
    names = [f"/{topic}" for topic in wanted]
    end_ns = start_ns + length_ns
    with open_excerpts(path) as part:
        assert (part.start_ns, part.end_ns) == (min(times_ns)[0], max(times_ns)[0])
        messages = [(each.log_ns, each.topic) for each in part.messages(wanted, start_ns, end_ns)]
        assert [time_ns for time_ns, _ in messages] == sorted(time_ns for time_ns, _ in messages)
        assert sorted(messages) == sorted(
            expected(path, topics=names, starting_at=start_ns, ending_before=end_ns)
        )
        newest = {each.topic: each.log_ns for each in part.latest_before(wanted, start_ns)}
    before = expected(path, topics=names, ending_before=start_ns)
    assert newest == {topic: max(t for t, name in before if name == topic) for _, topic in before}
