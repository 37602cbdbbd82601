"""The commands that the simulator adds to `thumper`. Heavy imports are deferred until a command runs."""

from pathlib import Path
from typing import Annotated, Literal

import typer

Preset = Annotated[
    Literal["nominal", "hard"], typer.Option(help="How hard the simulated robot is: nominal or hard.")
]
DEMO_INTRODUCTION = """\
A simulated robot drives two missions in a laboratory that it does not know:
straight to a goal, and around a box. Its simulated board runs the real firmware.
The results will be in {out}/.
"""
Seed = Annotated[int, typer.Option(help="Seed of the random numbers.", min=0, max=2**32 - 1)]


def demo(
    out: Annotated[Path, typer.Option(help="Folder for the maps, pictures and figures.")] = Path("out"),
    seed: Seed = 1,
    realtime: Annotated[bool, typer.Option("--realtime", help="Run in real time.")] = False,
    seeds: Annotated[
        int,
        typer.Option(help="Drive both missions with this many seeds, starting at --seed.", min=1, max=10_000),
    ] = 1,
    preset: Preset = "nominal",
    ui: Annotated[
        bool,
        typer.Option(
            "--ui",
            help="Show the drives in the browser, in real time; then drive the robot there until Ctrl-C.",
        ),
    ] = False,
) -> None:
    """Drive two missions with the real firmware on a simulated robot and report the results.

    --seeds writes a table and one CSV row per drive. Then the exit status is 0 only if the robot reached
    every goal within 0.10 m (ground truth) without a contact, otherwise 1.

    Examples:

    - `thumper demo --ui`
    - `thumper demo --seeds 20 --out out/seeds`
    """
    from rich.console import Console

    from thumper.cli.output.folder import prepare_output
    from thumper.common.errors import EXIT_USAGE, ThumperError

    if seeds > 1 and (realtime or ui):
        raise ThumperError(
            "--seeds cannot be combined with --realtime or --ui; omit one of them", exit_code=EXIT_USAGE
        )
    prepare_output(out)
    if seeds > 1:
        from thumper_hil.demo.repeat import run_seeds

        if not run_seeds(out, first_seed=seed, seeds=seeds, console=Console(), preset=preset):
            raise typer.Exit(1)
        return
    console = Console()
    console.print(DEMO_INTRODUCTION.format(out=out), highlight=False, soft_wrap=True)
    if ui:
        from thumper_hil.demo.in_browser import run_in_browser

        passed = run_in_browser(out, seed=seed, console=console, preset=preset)
    else:
        from thumper_hil.demo.run import run_demo

        passed = run_demo(out, seed=seed, realtime=realtime, console=console, preset=preset)
    if not passed:
        raise typer.Exit(1)


def _worlds() -> list[str]:
    from thumper_hil.world.world_file import suggested_worlds

    return suggested_worlds()


def _lidars() -> list[str]:
    from typing import get_args

    from thumper.lidar.options import LidarModel

    return list(get_args(LidarModel))


def sim(
    board_pty: Annotated[Path, typer.Option(help="Path of the simulated board's serial port.")],
    lidar_pty: Annotated[Path, typer.Option(help="Path of the simulated lidar's serial port.")],
    world: Annotated[
        str,
        typer.Option(
            help="World (charging, hall, lab, lab_box, passage, people, ramp, yard, or house-N with any "
            "number N), world file (TOML) or map (YAML).",
            autocompletion=_worlds,
        ),
    ] = "lab",
    seed: Seed = 1,
    start: Annotated[
        tuple[float, float, float] | None,
        typer.Option(
            metavar="X Y DEGREES",
            help="Start pose: X and Y in metres, heading in degrees; default: 0 0 0, in a house its own.",
        ),
    ] = None,
    reset_on_open: Annotated[
        bool,
        typer.Option(
            "--reset-on-open", help="Reset the board through its boot loader when its port is opened (DTR)."
        ),
    ] = False,
    bare: Annotated[
        bool,
        typer.Option("--bare", help="The board holds its boot loader only; implies --reset-on-open."),
    ] = False,
    scenario: Annotated[str, typer.Option(help="Scenario file (TOML) that schedules faults.")] = "",
    lidar: Annotated[
        str,
        typer.Option(
            help="Lidar model: urg04lx, ld19, rplidar_a1, rplidar_a2, rplidar_c1 or ydlidar_x4.",
            autocompletion=_lidars,
        ),
    ] = "urg04lx",
    preset: Preset = "nominal",
    floor: Annotated[
        str,
        typer.Option(
            help="linoleum, wood, concrete, carpet, deep_carpet, or stand: wheels in the air; "
            "default: the preset's."
        ),
    ] = "",
) -> None:
    """Serve a simulated robot on two pseudo-terminals in real time, for programs that expect hardware.

    Example: `thumper sim --board-pty /tmp/board --lidar-pty /tmp/lidar --world house-4`
    """
    from thumper_hil.bench.pty import serve

    serve(
        board_pty,
        lidar_pty,
        {
            "world": world,
            "seed": str(seed),
            **(dict(zip(("x_m", "y_m", "yaw_deg"), map(str, start), strict=True)) if start else {}),
            "scenario": scenario,
            "lidar": lidar,
            "preset": preset,
            **({"floor": floor} if floor else {}),
            "reset_on_open": str(int(reset_on_open or bare)),
            "bare": str(int(bare)),
        },
    )
