"""The wheels alone as a recording: what an experiment on the motors leaves."""

from collections.abc import Iterable
from pathlib import Path

from thumper.board.board import TelemetrySample
from thumper.common.stamps import stamp_ns
from thumper.recording.mcap_file import PART, McapFile
from thumper.ros.codec import encode
from thumper.ros.to_ros import Messages


def write_wheels(path: Path, samples: Iterable[TelemetrySample], epoch_ns: int) -> None:
    """Write the samples as topics `wheels` and `battery`, in place of what was at `path`. Raises OSError."""
    for old in (path, path.with_name(path.name + PART)):
        old.unlink(missing_ok=True)
    file, messages = McapFile(path, {}), Messages(epoch_ns=epoch_ns)
    for sample in samples:
        log_ns = stamp_ns(sample.time_s, epoch_ns)
        for topic, message in (("wheels", messages.wheels(sample)), ("battery", messages.battery(sample))):
            file.add(topic, message.__msgtype__, log_ns, encode(message))
    file.close()
