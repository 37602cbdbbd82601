"""Compile all kernels into their packages: `THUMPER_SHIP_KERNELS=1 python scripts/ship_kernels.py`.

`make` and the wheel's build run it, in two processes. It warms up every mapper, planner and controller, and
drives the demo's missions for the kernels of the simulator. What is there and fits its sources is loaded.
"""

import os
import signal
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from typing import get_args

from rich.console import Console

from thumper.common.compile_progress import KernelCounter, compile_progress
from thumper.common.geometry import Pose2
from thumper.common.numba_kernel import SHIP_VARIABLE
from thumper.config.robot import RobotConfig
from thumper.navigation.registry import CONTROLLERS, PLANNERS
from thumper.navigation.warm_up import warm_up as warm_up_navigation
from thumper.runtime.assembly import robot_mapper
from thumper.slam.factory import Method
from thumper_hil.demo.missions import MISSIONS
from thumper_hil.demo.run import drive_mission
from thumper_tuning.warm_up import warm_up as warm_up_identification

_counters: list[KernelCounter] = []  # of the second process
KERNELS = 411  # of all options and of the simulator


def _share(counter: KernelCounter) -> None:
    _counters.append(counter)


def compile_mappers() -> None:
    """Compile what is missing of the mappers and of the identification."""
    config = RobotConfig()
    with compile_progress(Console(quiet=True), counter=_counters[0]):
        for method in get_args(Method):
            robot_mapper(replace(config, mapping=replace(config.mapping, method=method)), Pose2()).warm_up()
        warm_up_identification()


def ship_kernels(console: Console) -> None:
    """Compile what is missing."""
    config = RobotConfig()
    options = config.navigation
    context = get_context("spawn")
    counter = context.Value("i", 0)
    with (
        ProcessPoolExecutor(1, context, initializer=_share, initargs=(counter,)) as second_process,
        compile_progress(console, expected=KERNELS, counter=counter),
    ):
        mappers = second_process.submit(compile_mappers)
        for planner in PLANNERS:
            warm_up_navigation(replace(options, planner=planner), config.footprint)
        for controller in CONTROLLERS:
            warm_up_navigation(replace(options, controller=controller, tracker=""), config.footprint)
        mappers.result()
        for mission in MISSIONS:
            drive_mission(mission, seed=0, realtime=False, console=Console(quiet=True))


if __name__ == "__main__":
    if SHIP_VARIABLE not in os.environ:
        sys.exit(f"set {SHIP_VARIABLE}=1, so that the kernels are written to their packages")
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # amid a compilation, numba turns Ctrl-C into other errors
    ship_kernels(Console())
