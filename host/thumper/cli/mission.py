"""A drive with a progress bar on the terminal; Ctrl-C stops the motors first."""

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn

from thumper.errors import ThumperError
from thumper.navigation.goal import Goal
from thumper.runtime import MissionResult, Runtime
from thumper.runtime import Progress as Beat


def drive_with_progress(robot: Runtime, goal: Goal, name: str, console: Console) -> MissionResult:
    """Drive to the goal and show how far it still is."""
    with Progress(
        TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[state]}"), console=console
    ) as progress:
        task = progress.add_task(name, total=None, state="looking round")
        farthest_m = 0.0

        def show(beat: Beat) -> None:
            nonlocal farthest_m
            farthest_m = max(farthest_m, beat.distance_to_goal_m)
            progress.update(
                task,
                total=farthest_m,
                completed=farthest_m - beat.distance_to_goal_m,
                state=f"{beat.distance_to_goal_m:5.2f} m to go, {beat.time_s:5.1f} s",
            )

        try:
            result = robot.drive_to(goal, show)
        except KeyboardInterrupt:
            raise ThumperError("interrupted; the motors are stopped", exit_code=130) from None
        ending = "reached" if result.reached else "not reached"
        progress.update(task, total=1.0, completed=1.0, state=f"{ending} after {result.time_s:.1f} s")
    return result
