"""The commands that the simulator adds to `thumper`. Heavy imports wait until a command runs."""

from pathlib import Path
from typing import Annotated

import typer

Seed = Annotated[int, typer.Option(help="Seed of all that is random.", min=0, max=2**32 - 1)]


def demo(
    out: Annotated[Path, typer.Option(help="Folder for the map, the pictures and the figures.")] = Path(
        "out"
    ),
    seed: Seed = 1,
    realtime: Annotated[bool, typer.Option(help="Run at the speed of the clock on the wall.")] = False,
    seeds: Annotated[
        int,
        typer.Option(
            help="Drive both missions with this many seeds, --seed being the first.", min=1, max=10_000
        ),
    ] = 1,
    ui: Annotated[
        bool, typer.Option("--ui", help="Show it in the browser, at the speed of the clock on the wall.")
    ] = False,
) -> None:
    """Drive two missions with the real firmware on a simulated robot, and show how it went.

    With --seeds a table and a line of CSV a drive; it leaves with 1 unless every goal was reached to 0.10 m
    of ground truth and nothing was touched.
    """
    from rich.console import Console

    from thumper.cli.output_folder import prepare_output
    from thumper.common.errors import EXIT_USAGE, ThumperError
    from thumper.config.bus import BusOptions
    from thumper.dashboard.process import beside
    from thumper_hil.demo.run import run_demo

    if seeds > 1 and (realtime or ui):
        raise ThumperError("--seeds is a statistic: leave --realtime and --ui", exit_code=EXIT_USAGE)
    prepare_output(out)
    if seeds > 1:
        from thumper_hil.demo.repeat import run_seeds

        if not run_seeds(out, first_seed=seed, seeds=seeds, console=Console()):
            raise typer.Exit(1)
        return
    with beside(None, BusOptions().address, wanted=ui):
        if not run_demo(out, seed=seed, realtime=realtime or ui, on_the_bus=ui, console=Console()):
            raise typer.Exit(1)


def sim(
    board_pty: Annotated[Path, typer.Option(help="Path at which the simulated board shall appear.")],
    lidar_pty: Annotated[Path, typer.Option(help="Path at which the simulated lidar shall appear.")],
    world: Annotated[
        str, typer.Option(help="A built-in world (hall, lab, lab_box), a world's TOML, or a map's YAML.")
    ] = "lab",
    seed: Seed = 1,
    start: Annotated[
        tuple[float, float, float],
        typer.Option(help="Where the robot stands: X and Y in metres, HEADING in degrees."),
    ] = (0.0, 0.0, 0.0),
    reset_on_open: Annotated[
        bool, typer.Option(help="Opening the board's port resets it through its boot loader, as DTR does.")
    ] = False,
    scenario: Annotated[str, typer.Option(help="A TOML file that says which fault happens when.")] = "",
    lidar: Annotated[str, typer.Option(help="The lidar's model: urg04lx or ld19.")] = "urg04lx",
) -> None:
    """Serve a simulated robot in real time on two pseudo-terminals, for programs that drive the hardware."""
    from thumper_hil.bench.pty import serve

    serve(
        board_pty,
        lidar_pty,
        {
            "world": world,
            "seed": str(seed),
            "x_m": str(start[0]),
            "y_m": str(start[1]),
            "yaw_deg": str(start[2]),
            "scenario": scenario,
            "lidar": lidar,
            "reset_on_open": str(int(reset_on_open)),
        },
    )
