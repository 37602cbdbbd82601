"""Write a recording of the wheels alone, for experiments on the motors."""

from collections.abc import Iterable
from pathlib import Path

from thumper.board.board import TelemetrySample
from thumper.common.stamps import stamp_ns
from thumper.recording.mcap_file import PART, McapFile
from thumper.ros.codec import encode
from thumper.ros.to_ros import Messages


def write_wheels(path: Path, samples: Iterable[TelemetrySample], epoch_ns: int) -> None:
    """Write the samples as topics `wheels` and `battery`; replaces `path`. Raises OSError."""
    for old in (path, path.with_name(path.name + PART)):
        old.unlink(missing_ok=True)
    file, messages = McapFile(path, {}), Messages(epoch_ns=epoch_ns)
    for sample in samples:
        log_ns = stamp_ns(sample.time_s, epoch_ns)
        for topic, message in (("wheels", messages.wheels(sample)), ("battery", messages.battery(sample))):
            file.add(topic, message.__msgtype__, log_ns, encode(message))
    file.close()
