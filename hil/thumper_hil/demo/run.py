"""Drive the demo's missions with the robot's own control loop and collect the results."""

import math
import time
from contextlib import ExitStack
from pathlib import Path
from urllib.parse import urlencode

from rich.console import Console

from thumper.board.options import BoardOptions
from thumper.bus.serve_robot import on_bus
from thumper.cli.options.record import recorded
from thumper.cli.output.drive_progress import ProgressDisplay, raise_if_interrupted
from thumper.config.robot import RobotConfig
from thumper.lidar.options import LidarOptions
from thumper.navigation.goal import Goal
from thumper.runtime.assembly import open_robot, warm_up
from thumper.runtime.drive.tasks import drive_to_goal
from thumper.slam.saved_state import SavedSlamState
from thumper_hil.bench import simulation
from thumper_hil.demo.map_error import compare_map
from thumper_hil.demo.missions import MISSIONS, DemoMission
from thumper_hil.demo.outcome import Outcome
from thumper_hil.demo.results import write_results
from thumper_hil.world.world import World


def run_demo(
    out: Path,
    *,
    seed: int,
    realtime: bool,
    console: Console,
    on_the_bus: bool = False,
    preset: str = "nominal",
) -> bool:
    """Drive all missions and write the results to `out`; return True if every mission passed."""
    with console.status("loading the compiled kernels (compiling them on the first run)"):
        warm_up(RobotConfig())
    outcomes = [
        drive_mission(
            mission,
            seed=seed,
            realtime=realtime,
            console=console,
            on_the_bus=on_the_bus,
            record_to=out / "recordings",
            preset=preset,
        )
        for mission in MISSIONS
    ]
    write_results(out, outcomes, {"seed": seed, "preset": preset}, console)
    return all(outcome.passed for outcome in outcomes)


def drive_mission(
    mission: DemoMission,
    *,
    seed: int,
    realtime: bool,
    console: Console,
    on_the_bus: bool = False,
    record_to: Path | None = None,
    preset: str = "nominal",
) -> Outcome:
    """Start a new robot without a map at the mission's start and drive to its goal.

    With `on_the_bus`, clients can watch and stop it. `record_to` is the folder for the recording, or None.
    """
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
    goal = Goal(x_m=mission.goal_x_m, y_m=mission.goal_y_m)
    started_s = time.perf_counter()
    with ExitStack() as stack:
        robot = stack.enter_context(open_robot(config, mission.start))
        if record_to:
            stack.enter_context(recorded(robot, config, mission.start, True, record_to))
        if on_the_bus:
            stack.enter_context(on_bus(robot, config.name, config.bus))
        bench = simulation(mission.name)
        result = robot.run(drive_to_goal(goal, mission.title), ProgressDisplay(console))
        raise_if_interrupted(result)
        wall_time_s = time.perf_counter() - started_s
        grid, session = robot.mapper.grid(), SavedSlamState.from_mapper(robot.mapper, result.map_from_base)
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
