"""The demo in the browser: both missions in real time, then a robot that the page drives."""

import threading
import time
from contextlib import ExitStack
from pathlib import Path

from rich.console import Console

from thumper.bus.server import BusServer
from thumper.cli.output.drive_progress import print_problems
from thumper.config.dashboard import check_options
from thumper.config.robot import RobotConfig
from thumper.dashboard.process import dashboard_process, open_pages
from thumper.ros.codec import Message
from thumper.ros.status import Status
from thumper.ros.to_ros import Messages
from thumper.runtime.loop import RobotLoop
from thumper.runtime.requests import LogMessage
from thumper.runtime.service.request_queue import RequestQueue
from thumper_hil.demo.free_ports import on_free_ports
from thumper_hil.demo.missions import MISSIONS
from thumper_hil.demo.results import NEXT_STEPS, print_next_steps, write_results
from thumper_hil.demo.run import drive, load_kernels, opened

SERVER_TIMEOUT_S = 30.0
PAGE_TIMEOUT_S = 20.0
NOTICE_PERIOD_S = 0.3
SILENT_S = 0.9  # of a robot; from 1.5 s the page reports a lost link
POLL_S = 0.2


class DemoBus:
    """The bus of all the demo's robots. While none of them runs, the pages show its notice."""

    def __init__(self, config: RobotConfig) -> None:
        """Open the bus; raise ThumperError if its address is in use."""
        self.notice = ""  # what the pages show while no robot sends anything
        self._messages = Messages()
        self._server = BusServer(config.name, config.bus, RequestQueue(), self._log)
        self._sent_s = 0.0  # by a robot
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._run, name="demo-notice", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Leave the bus."""
        self._closed.set()
        self._thread.join()
        self._server.close()

    def connect(self, robot: RobotLoop) -> None:
        """Serve this robot from now on."""
        self._server.requests = robot.request_queue
        robot.publisher.add_sink(self._publish)

    def _publish(self, topic: str, stamp_s: float, message: Message) -> None:
        self._sent_s = time.monotonic()
        self._server.publish(topic, stamp_s, message)

    def _log(self, text: str) -> None:
        self._server.requests.put(LogMessage(text=text))

    def _run(self) -> None:
        while not self._closed.wait(NOTICE_PERIOD_S):
            if time.monotonic() - self._sent_s > SILENT_S:
                now_s = time.time()
                status = Status(time_s=now_s, reason=self.notice, simulated=True)
                self._server.publish("status", now_s, self._messages.status(status))


def run_in_browser(out: Path, *, seed: int, console: Console, preset: str = "nominal") -> bool:
    """Drive all missions while a page shows them; return True if every mission passed.

    At the end, the last robot stays for the page until Ctrl-C.
    """
    config = on_free_ports(RobotConfig())
    url = check_options(config.dashboard).url
    with ExitStack() as stack:
        stack.enter_context(dashboard_process(None, config.bus.address, port=config.dashboard.port))
        bus = DemoBus(config)
        stack.callback(bus.close)
        bus.notice = "the demo is loading; its first run compiles for this computer, for some minutes"
        load_kernels(console)
        wait_for_page(url, console)
        robots = stack.enter_context(ExitStack())
        outcomes = []
        for number, mission in enumerate(MISSIONS, start=1):
            robots.close()  # of the mission before
            title = f"mission {number} of {len(MISSIONS)}: {mission.title}"
            console.print(title, highlight=False)
            bus.notice = f"starting {title}"
            started_s = time.perf_counter()
            robot = robots.enter_context(
                opened(mission, seed=seed, realtime=True, record_to=out / "recordings", preset=preset)
            )
            bus.connect(robot)
            robot.request_queue.put(LogMessage(text=title))  # the time of the events begins again
            bus.notice = f"mission {number} of {len(MISSIONS)} is over; comparing its map with the room"
            outcomes.append(drive(robot, mission, console, started_s=started_s))
        bus.notice = "both missions are over; writing the results"
        write_results(out, outcomes, {"seed": seed, "preset": preset}, console)
        print_next_steps(console, NEXT_STEPS[1:])  # the first is this demo
        if open_pages(url):
            console.print(
                "The demo is over. Now you can drive the robot on the dashboard. Press Ctrl-C to stop."
            )
            robot.drive_manager.abort("the demo is over; now you can drive the robot")
            robot.publisher.add_sink(print_problems)
            robot.serve()
        else:
            console.print(f"No browser shows {url}, so the demo ends here.")
    return all(outcome.passed for outcome in outcomes)


def wait_for_page(url: str, console: Console) -> None:
    """Wait until a browser shows the page, at most `PAGE_TIMEOUT_S` from when it can."""
    server_end_s = time.monotonic() + SERVER_TIMEOUT_S
    while open_pages(url) is None and time.monotonic() < server_end_s:
        time.sleep(POLL_S)
    console.print(f"Open {url} in a browser. The robot starts then, or in {PAGE_TIMEOUT_S:g} s.")
    end_s = time.monotonic() + PAGE_TIMEOUT_S
    while not open_pages(url) and time.monotonic() < end_s:
        time.sleep(POLL_S)
