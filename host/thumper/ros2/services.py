"""The node's services: commands, map, costmaps. Nav2's names where Nav2 has them."""

from functools import partial

import numpy as np

from thumper.bus.client import BusClient
from thumper.common.errors import ThumperError
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.ros import services
from thumper.ros.codec import Message, message
from thumper.ros.services import RunCommand
from thumper.ros.to_ros import Messages
from thumper.ros2.interfaces import CLEAR_COSTMAP, GET_MAP, SAVE_MAP, TRIGGER
from thumper.ros2.node import GraphNode, PendingCall

TRIGGERS = {  # service: command of the robot
    "~/arm": "arm",
    "~/disarm": "disarm",
    "~/emergency_stop": "estop",
    "~/clear_fault": "clear_fault",
    "~/cancel": "cancel",
    "~/save_map": "save_map",
}
CLEARED = (
    "global_costmap/clear_entirely_global_costmap",
    "local_costmap/clear_entirely_local_costmap",
)


class RosServices:
    """Answers the services of one robot. `map` is its newest map, if it has one."""

    def __init__(self, bus: BusClient, node: GraphNode, *, navigates: bool = True) -> None:
        self._bus = bus
        self.map: Message | None = None
        bus.subscribe("map", self._on_map)
        for service, command in TRIGGERS.items():
            node.serve(service, TRIGGER, partial(self._trigger, command))
        for service in CLEARED if navigates else ():
            node.serve(service, CLEAR_COSTMAP, self._clear_costmaps)
        node.serve("map_server/map", GET_MAP, self._get_map)
        node.serve("map_saver/save_map", SAVE_MAP, self._save_map)

    def _on_map(self, grid: Message) -> None:
        self.map = grid

    def _run(self, command: str) -> tuple[bool, str]:
        """Return whether the robot did it, and what it says."""
        try:
            return True, services.COMMAND.call(self._bus, RunCommand(command=command)).text
        except ThumperError as error:
            return False, str(error)

    def _trigger(self, command: str, call: PendingCall) -> None:
        success, text = self._run(command)
        call.reply(message(f"{TRIGGER}_Response", success=success, message=text))

    def _clear_costmaps(self, call: PendingCall) -> None:
        self._run("clear_costmaps")
        empty = message("std_msgs/msg/Empty", structure_needs_at_least_one_member=0)
        call.reply(message(f"{CLEAR_COSTMAP}_Response", response=empty))

    def _get_map(self, call: PendingCall) -> None:
        """Reply with the newest map; before the first, with one of no cells."""
        none = OccupancyGrid(
            cells=np.empty((0, 0), np.int8), resolution_m=0.05, origin_x_m=0.0, origin_y_m=0.0
        )
        grid = Messages().grid(0.0, none) if self.map is None else self.map
        call.reply(message(f"{GET_MAP}_Response", map=grid))

    def _save_map(self, call: PendingCall) -> None:
        """Save where the robot saves. No text from outside becomes a path, so another place is refused."""
        success = not call.request.map_url and self._run("save_map")[0]
        call.reply(message(f"{SAVE_MAP}_Response", result=success))
