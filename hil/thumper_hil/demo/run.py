"""Drive the demo's missions with the robot's own control loop and collect the results."""

import math
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from urllib.parse import urlencode

from rich.console import Console

from thumper.board.options import BoardOptions
from thumper.cli.options.record import recorded
from thumper.cli.output.drive_progress import ProgressDisplay, raise_if_interrupted
from thumper.common.compile_progress import compile_progress
from thumper.config.robot import RobotConfig
from thumper.lidar.options import LidarOptions
from thumper.navigation.goal import Goal
from thumper.runtime.assembly import open_robot, warm_up
from thumper.runtime.drive.tasks import drive_to_goal
from thumper.runtime.loop import RobotLoop
from thumper.slam.saved_state import SavedSlamState
from thumper_hil.bench import simulation
from thumper_hil.demo.map_error import compare_map
from thumper_hil.demo.missions import MISSIONS, DemoMission
from thumper_hil.demo.outcome import Outcome
from thumper_hil.demo.results import print_next_steps, write_results
from thumper_hil.world.world import World


def run_demo(out: Path, *, seed: int, realtime: bool, console: Console, preset: str = "nominal") -> bool:
    """Drive all missions and write the results to `out`; return True if every mission passed."""
    load_kernels(console)
    outcomes = [
        drive_mission(
            mission,
            seed=seed,
            realtime=realtime,
            console=console,
            record_to=out / "recordings",
            preset=preset,
        )
        for mission in MISSIONS
    ]
    write_results(out, outcomes, {"seed": seed, "preset": preset}, console)
    print_next_steps(console)
    return all(outcome.passed for outcome in outcomes)


def load_kernels(console: Console) -> None:
    """Load the compiled kernels; the first run compiles them."""
    with compile_progress(console, "loading the compiled kernels"):
        warm_up(RobotConfig())


def drive_mission(
    mission: DemoMission,
    *,
    seed: int,
    realtime: bool,
    console: Console,
    record_to: Path | None = None,
    preset: str = "nominal",
) -> Outcome:
    """Start a new robot without a map at the mission's start and drive to its goal.

    `record_to` is the folder for the recording, or None.
    """
    started_s = time.perf_counter()
    with opened(mission, seed=seed, realtime=realtime, record_to=record_to, preset=preset) as robot:
        return drive(robot, mission, console, started_s=started_s)


@contextmanager
def opened(
    mission: DemoMission, *, seed: int, realtime: bool, record_to: Path | None, preset: str
) -> Iterator[RobotLoop]:
    """Open a new robot without a map at the mission's start."""
    options = {
        "world": mission.world,
        "x_m": mission.start.x_m,
        "y_m": mission.start.y_m,
        "yaw_deg": math.degrees(mission.start.theta_rad),
        "seed": seed,
        "preset": preset,
    }
    if realtime:
        options["pace"] = "realtime"
    config = RobotConfig(
        board=BoardOptions(port=f"sim://{mission.name}/board?{urlencode(options)}"),
        lidar=LidarOptions(port=f"sim://{mission.name}/lidar"),
    )
    with ExitStack() as stack:
        robot = stack.enter_context(open_robot(config, mission.start))
        if record_to:
            stack.enter_context(recorded(robot, config, mission.start, True, record_to, quiet=True))
        yield robot


def drive(robot: RobotLoop, mission: DemoMission, console: Console, *, started_s: float) -> Outcome:
    """Drive to the mission's goal; `started_s` is when the robot was opened [s, `perf_counter`]."""
    goal = Goal(x_m=mission.goal_x_m, y_m=mission.goal_y_m)
    result = robot.run(drive_to_goal(goal, mission.title), ProgressDisplay(console))
    raise_if_interrupted(result)
    wall_time_s = time.perf_counter() - started_s
    grid, session = robot.mapper.grid(), SavedSlamState.from_mapper(robot.mapper, result.pose)
    bench = simulation(mission.name)
    return Outcome(
        mission=mission,
        result=result,
        log=robot.log,
        grid=grid,
        session=session,
        truth=bench.truth(),
        collisions=bench.contacts,
        map_quality=compare_map(grid, World.load(mission.world)),
        sim_time_s=bench.time_s,
        wall_time_s=wall_time_s,
    )
