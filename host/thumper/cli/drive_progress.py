"""Drive to a goal with a progress bar in the terminal; Ctrl-C stops the motors first."""

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn

from thumper.common.errors import EXIT_INTERRUPTED, ThumperError
from thumper.navigation.goal import Goal
from thumper.runtime.drive_result import DriveProgress, DriveResult
from thumper.runtime.loop import RobotLoop

PLAIN_PERIOD_S = 1.0


def drive_with_progress(
    robot: RobotLoop, goal: Goal, name: str, console: Console, *, clear_fault: bool = False
) -> DriveResult:
    """Drive to the goal; show the remaining distance as a bar, or one line per second without a terminal."""
    with Progress(
        TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[state]}"), console=console
    ) as progress:
        task = progress.add_task(name, total=None, state="looking round")
        farthest_m, next_line_s = 0.0, 0.0

        def show(cycle: DriveProgress) -> None:
            nonlocal farthest_m, next_line_s
            farthest_m = max(farthest_m, cycle.distance_to_goal_m)
            state = f"{cycle.distance_to_goal_m:5.2f} m to go, {cycle.time_s:5.1f} s"
            if not (console.is_terminal or console.quiet) and cycle.time_s >= next_line_s:
                print(f"{name}: {state}", flush=True)
                next_line_s = cycle.time_s + PLAIN_PERIOD_S
            progress.update(
                task,
                total=farthest_m,
                completed=farthest_m - cycle.distance_to_goal_m,
                state=state,
            )

        result = robot.drive_to(goal, show, clear_fault=clear_fault)
        if result.reached:
            progress.update(task, total=1.0, completed=1.0, state=f"reached after {result.time_s:.1f} s")
        else:
            progress.update(task, state=f"not reached after {result.time_s:.1f} s")
    return result


def print_notes(robot: RobotLoop, console: Console) -> None:
    """Print what was wrong with scans and wheels during the drive: one line per kind, with its count."""
    for line in robot.inputs.estimator.notes().values():
        console.print(f"note: {line}", markup=False, soft_wrap=True)


def raise_if_interrupted(result: DriveResult) -> None:
    """Raise `ThumperError` after Ctrl-C, which ends the whole command; the robot has stopped already."""
    if result.interrupted:
        raise ThumperError(result.reason, exit_code=EXIT_INTERRUPTED)
