"""Start and stop the recording of a running robot, from the command line, the page or the bus."""

import json
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from thumper.common.geometry import Pose2
from thumper.config.robot import RobotConfig
from thumper.recording.recorder import Recorder
from thumper.recording.repair import repair_in_subprocess
from thumper.recording.run_metadata import RunMetadata, firmware_text
from thumper.ros.to_ros import text
from thumper.runtime.loop import RobotLoop
from thumper.slam.mapper import SwitchesMode


class RecordingControl:
    """Starts and stops one recorder at a time. The robot's loop never waits for the disk."""

    def __init__(
        self,
        robot: RobotLoop,
        config: RobotConfig,
        map_from_base: Pose2,
        folder: Path,
        report: Callable[[str], None],
    ) -> None:
        """`map_from_base` is the start pose; `report` may be called from another thread."""
        self._robot, self._config, self._start_pose = robot, config, map_from_base
        self._folder, self._report = folder, report
        self._recorder: Recorder | None = None

    def run_metadata(self) -> RunMetadata:
        """Return the metadata of a recording that starts now."""
        inputs, mapper = self._robot.inputs, self._robot.mapper
        board, state = inputs.board, inputs.estimator.state()
        is_localizing = isinstance(mapper, SwitchesMode) and mapper.is_localizing
        return RunMetadata(
            config=self._config,
            epoch_ns=self._robot.publisher.messages.epoch_ns,
            map_from_base=state.map_from_base if state else self._start_pose,
            simulated=board.port.is_simulated,
            firmware=firmware_text(board.identity),
            from_start=state is None and not is_localizing,
        )

    def start(self) -> str:
        """Start recording; return a line that says so."""
        if self._recorder is not None and self._recorder.active:
            return "already recording"
        self._detach()  # a recorder that has stopped on its own
        publisher = self._robot.publisher
        publisher.recorder = self._recorder = Recorder(self._folder, self.run_metadata(), report=self._report)
        publisher.add_sink(self._recorder)
        return f"recording to {self._folder}/"

    def stop(self) -> str:
        """Stop recording; return a line that says so. The recorder's thread finishes the file."""
        recorder = self._detach()
        if recorder is None:
            return "not recording"
        recorder.finish()
        return f"recorded {recorder.written} messages"

    def close(self) -> Recorder | None:
        """Stop and wait until the file is complete; return the recorder with its counts."""
        recorder = self._detach()
        if recorder is not None:
            recorder.close()
        return recorder

    def _detach(self) -> Recorder | None:
        recorder, self._recorder = self._recorder, None
        if recorder is not None:
            self._robot.publisher.remove_sink(recorder)
            self._robot.publisher.recorder = None
        return recorder


@contextmanager
def recording_control(
    robot: RobotLoop, config: RobotConfig, map_from_base: Pose2, folder: Path, report: Callable[[str], None]
) -> Iterator[RecordingControl]:
    """Yield the recording control and register `record_start` and `record_stop`; repair old files first."""
    repair_in_subprocess(folder)
    control = RecordingControl(robot, config, map_from_base, folder, report)
    # Simulated robots start alike: the id distinguishes their runs.
    metadata = control.run_metadata().as_metadata() | {"process": uuid.uuid4().hex}
    robot.publisher.publish_text("session", text(json.dumps(metadata)))
    robot.request_handler.handlers.update(record_start=control.start, record_stop=control.stop)
    try:
        yield control
    finally:
        control.close()
