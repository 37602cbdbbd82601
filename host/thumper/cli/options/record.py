"""`--record` and `--record-to` of the commands that drive a robot."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from thumper.common.geometry import Pose2
    from thumper.config.robot import RobotConfig
    from thumper.runtime.loop import RobotLoop


@contextmanager
def recorded(
    robot: "RobotLoop",
    settings: "RobotConfig",
    start: "Pose2 | None",
    record: bool,
    record_to: Path | None,
    *,
    serving: bool = False,
    quiet: bool = False,
) -> Iterator[None]:
    """Record from the start if requested; `record_start` and `record_stop` work over the bus in any case.

    `quiet` prints failures only.

    Raises
    ------
    ThumperError
        The folder cannot be written.
    """
    from thumper.cli.output.folder import prepare_output
    from thumper.cli.output.recording_summary import recording_failure, recording_summary
    from thumper.cli.output.stderr_report import report_to_stderr
    from thumper.common.geometry import Pose2
    from thumper.recording.start_stop import recording_control
    from thumper.runtime.requests import LogMessage

    folder = record_to or Path(settings.recording.folder)

    def say(text: str) -> None:
        if not serving:  # else the events are printed
            report_to_stderr(text)
        robot.request_queue.put(LogMessage(text=text))

    with recording_control(robot, settings, start or Pose2(), folder, say) as switch:
        if record or record_to:
            prepare_output(folder, "--record-to")
            started = switch.start()
            if not quiet:
                print(f"{started}; at most {settings.recording.budget_MB:g} MB, the oldest go first")
        try:
            yield
        finally:
            recorder = switch.close()
            if recorder is not None:
                if not quiet:
                    print(f"recorded {recording_summary(recorder)}")
                if failure := recording_failure(recorder):
                    report_to_stderr(failure)
