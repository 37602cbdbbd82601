"""Carries messages between the robot's bus and its node in the ROS graph.

A client of the bus in its own process, so that it cannot delay the robot. The robot checks its requests as it
checks everybody's.
"""

import time
from collections.abc import Callable
from functools import partial

from thumper.bus.client import BusClient
from thumper.common.errors import ThumperError
from thumper.common.texts import shortened
from thumper.config.robot import RobotConfig
from thumper.ros.codec import Message, decode, encode, message
from thumper.ros.to_ros import BASE, Messages, text, transform
from thumper.ros.topics import TOPICS
from thumper.ros2.diagnostics import clock, diagnostics
from thumper.ros2.node import GraphNode, MessageSink
from thumper.ros2.topics import CLOCK, DEFAULT, DESCRIPTION, DIAGNOSTICS, IN, NAVIGATION, OUT
from thumper.ros2.urdf import link_poses, urdf

DIAGNOSTICS_PERIOD_S = 1.0
REPORT_PERIOD_S = 1.0


class RosGateway:
    """Serves one robot; it ends with its bus client and its node."""

    def __init__(
        self,
        bus: BusClient,
        node: GraphNode,
        config: RobotConfig,
        report: Callable[[str], None],
        *,
        navigates: bool = True,
    ) -> None:
        """`report` receives a line about a message that cannot be passed on.

        Without `navigates` there are no goals, plans and costmaps: another program has topics of these names.
        """
        self._bus, self._node, self._config, self._report = bus, node, config, report
        self._reported_s = self._diagnosed_s = float("-inf")
        self._battery: Message | None = None
        self._clock: MessageSink | None = None
        self._publish_description()
        self._diagnostics = node.publisher(DIAGNOSTICS.name, "diagnostic_msgs/msg/DiagnosticArray", DEFAULT)
        hidden = () if navigates else NAVIGATION
        for ros_topic, type_name, topic in IN:
            if topic in hidden:
                continue
            receive = self.on_twist if type_name.endswith("/Twist") else partial(self._pass_on, topic)
            node.subscribe(ros_topic.name, type_name, ros_topic.qos, receive)
        for topic, ros_topic in OUT.items():
            if topic in hidden:
                continue
            publisher = node.publisher(ros_topic.name, TOPICS[topic].type_name, ros_topic.qos)
            send = partial(self._send_static, publisher) if topic == "tf_static" else publisher.publish
            bus.subscribe_raw(topic, send, latched=True)
        bus.subscribe("battery", self._on_battery)
        bus.subscribe("status", self._on_status)

    def _publish_description(self) -> None:
        publisher = self._node.publisher(DESCRIPTION.name, "std_msgs/msg/String", DESCRIPTION.qos)
        publisher.publish(encode(text(urdf(self._config))))

    def _send_static(self, publisher: MessageSink, raw: bytes) -> None:
        """Add the wheels' links to the sensors', so that viewers can draw the whole robot."""
        transforms = decode(raw, TOPICS["tf_static"].type_name)
        header = transforms.transforms[0].header  # of base_link
        links = [transform(header, link, pose) for link, pose in link_poses(self._config).items()]
        transforms.transforms = [*transforms.transforms, *links]
        publisher.publish(encode(transforms))

    def _on_battery(self, battery: Message) -> None:
        self._battery = battery

    def _on_status(self, status: Message) -> None:
        if status.simulated:
            if self._clock is None:
                self._clock = self._node.publisher(CLOCK.name, "rosgraph_msgs/msg/Clock", CLOCK.qos)
            self._clock.publish(encode(clock(status)))
        now_s = time.monotonic()
        if now_s - self._diagnosed_s >= DIAGNOSTICS_PERIOD_S:
            self._diagnosed_s = now_s
            self._diagnostics.publish(encode(diagnostics(status, self._battery)))

    def on_twist(self, raw: bytes) -> None:
        """Pass a Twist on as a manual command."""
        try:
            twist = decode(raw, "geometry_msgs/msg/Twist")
        except ValueError as error:
            self._refuse(f"cmd_vel: {error}")
            return
        stamped = message("geometry_msgs/msg/TwistStamped", header=Messages().header(0.0, BASE), twist=twist)
        self._pass_on("velocity", encode(stamped))

    def _pass_on(self, topic: str, raw: bytes) -> None:
        try:
            self._bus.publish_raw(topic, raw)
        except ThumperError as error:  # the robot is gone; the command reports it
            self._refuse(f"{topic}: {error}")

    def _refuse(self, problem: str) -> None:
        now_s = time.monotonic()
        if now_s - self._reported_s >= REPORT_PERIOD_S:
            self._reported_s = now_s
            self._report(shortened(problem))
