"""Recording of a robot that runs: on and off at any time, from the command line, the page or the bus."""

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from thumper.common.geometry import Pose2
from thumper.config.robot import RobotConfig
from thumper.recording.recorder import Recorder
from thumper.recording.repair import recover_apart
from thumper.recording.run_metadata import RunMetadata, firmware_words
from thumper.ros.to_ros import text
from thumper.runtime.loop import RobotLoop
from thumper.slam.mapper import SwitchesMode


class RecordSwitch:
    """Starts and stops one recorder at a time; neither ever makes the robot's loop wait for a disk."""

    def __init__(
        self,
        robot: RobotLoop,
        config: RobotConfig,
        map_from_base: Pose2,
        folder: Path,
        say: Callable[[str], None],
    ) -> None:
        """`map_from_base` is where the robot was at the start; `say` may be called from another thread."""
        self._robot, self._config, self._start_pose = robot, config, map_from_base
        self._folder, self._say = folder, say
        self._recorder: Recorder | None = None

    def session(self) -> RunMetadata:
        """What a recording that begins now says of the run."""
        board = self._robot.inputs.board
        situation, mapper = self._robot.inputs.estimator.state(), self._robot.mapper
        localizing = isinstance(mapper, SwitchesMode) and mapper.is_localizing
        return RunMetadata(
            config=self._config,
            epoch_ns=self._robot.publisher.messages.epoch_ns,
            map_from_base=situation.map_from_base if situation else self._start_pose,
            simulated=board.port.is_simulated,
            firmware=firmware_words(board.identity),
            from_start=situation is None and not localizing,
        )

    def start(self) -> str:
        """Record from now on; returns what was done, in words."""
        if self._recorder is not None and self._recorder.active:
            return "it records already"
        self._leave()  # one that has stopped by itself
        publisher = self._robot.publisher
        self._recorder = Recorder(self._folder, self.session(), say=self._told)
        publisher.add_sink(self._recorder)
        publisher.recording = True
        return f"recording to {self._folder}/"

    def stop(self) -> str:
        """Record no more; returns what was done, in words. The file is finished meanwhile."""
        recorder = self._leave()
        if recorder is None:
            return "it does not record"
        recorder.finish()
        return f"recorded {recorder.written} messages"

    def close(self) -> Recorder | None:
        """Stop and wait until the file is whole; returns the recorder that ran, with its figures."""
        recorder = self._leave()
        if recorder is not None:
            recorder.close()
        return recorder

    def _leave(self) -> Recorder | None:
        recorder, self._recorder = self._recorder, None
        if recorder is not None:
            self._robot.publisher.remove_sink(recorder)
            self._robot.publisher.recording = False
        return recorder

    def _told(self, text: str) -> None:
        self._robot.publisher.recording = False
        self._say(text)


@contextmanager
def recording_switch(
    robot: RobotLoop, config: RobotConfig, map_from_base: Pose2, folder: Path, say: Callable[[str], None]
) -> Iterator[RecordSwitch]:
    """Give the robot its switch, also for `record_start` and `record_stop`; first mend what a crash left."""
    recover_apart(folder)
    switch = RecordSwitch(robot, config, map_from_base, folder, say)
    robot.publisher.publish_text(
        "session", text(json.dumps(switch.session().as_metadata()))
    )  # for `thumper record`
    robot.request_handler.handlers.update(record_start=switch.start, record_stop=switch.stop)
    try:
        yield switch
    finally:
        switch.close()
