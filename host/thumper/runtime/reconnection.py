"""Opens the board's port again after the board was lost: one step per cycle, while requests are answered."""

import time
from collections.abc import Callable, Generator

from thumper.board.board import Board
from thumper.common.errors import ThumperError
from thumper.ros.to_ros import ERROR, WARN
from thumper.runtime.drive.drive_manager import DriveManager
from thumper.runtime.publisher import Publisher
from thumper.runtime.sensor_inputs import SensorInputs
from thumper.runtime.service.wheels import read_again

RECONNECT_PERIOD_S = 0.1

Connecting = Generator[None, None, Board]
"""Opens a board; yields after each unanswered request, at most 0.1 s apart."""


class Reconnection:
    """Until the board answers again, its own time-out keeps the motors off."""

    def __init__(
        self,
        inputs: SensorInputs,
        drive_manager: DriveManager,
        publisher: Publisher,
        connect: Callable[[], Connecting],
    ) -> None:
        self.reason = ""  # why the board was lost; empty: it is connected
        self._inputs = inputs
        self._drive_manager = drive_manager
        self._publisher = publisher
        self._connect = connect
        self._connecting: Connecting | None = None
        self._problem = ""  # why the last attempt failed

    @property
    def is_active(self) -> bool:
        """Whether the board is lost."""
        return bool(self.reason)

    def begin(self, reason: str) -> None:
        """Give up the present board."""
        self.reason, self._connecting, self._problem = reason, None, reason
        self._publisher.publish_event(reason, ERROR, name="board")
        self._inputs.board.close()

    def step(self) -> None:
        """Try once to reach the board; once it answers, the reconnection is over."""
        try:
            if self._connecting is None:
                self._connecting = self._connect()
            next(self._connecting)
        except StopIteration as connected:
            self._take(connected.value)
        except ThumperError as error:
            self._connecting = None
            if str(error) != self._problem:
                self._problem = str(error)
                self._publisher.publish_event(self._problem, WARN, name="board")
            time.sleep(RECONNECT_PERIOD_S)

    def _take(self, board: Board) -> None:
        self.reason, self._connecting = "", None
        self._inputs.replace_board(board)
        read_again(self._inputs.estimator, board)  # another board, or one that lost its parameters
        self._drive_manager.board, self._drive_manager.reason = board, ""
        self._publisher.publish_event("the board answers again; the motors are off", name="board")
