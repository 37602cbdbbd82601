"""What a command reports about a recording at its end."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from thumper.recording.recorder import Recorder


def recording_summary(recorder: "Recorder") -> str:
    """Return how many messages were recorded, how many are missing, and the newest file, if there is one."""
    missing = f", {recorder.dropped} missing: the disk was full or too slow" if recorder.dropped else ""
    file = f": {recorder.files[-1]}" if recorder.files else ""
    return f"{recorder.written} messages{missing}{file}"


def recording_failure(recorder: "Recorder") -> str:
    """Return why the recording ended early and what to do; empty if it did not."""
    if not recorder.failure:
        return ""
    repair = (
        f"; `thumper recover {recorder.files[-1].parent}` repairs its last file" if recorder.files else ""
    )
    return f"the recording ended early: {recorder.failure}{repair}"
