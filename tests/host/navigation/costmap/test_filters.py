"""Keep-out and speed masks: the three modes of their files, and their effect on planner and robot."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2
from thumper.maps.map_server_io import encode_pgm, load_map, save_map
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.navigation.controllers.speed_limiter import SpeedLimiter
from thumper.navigation.costmap.costmap import CostmapOptions, build_costmap
from thumper.navigation.costmap.filters import (
    CostmapFilterOptions,
    keepout_cells,
    load_mask,
    load_masks,
    speed_fractions,
)
from thumper.navigation.costmap.inflation import LETHAL
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.navigator import NavigationState
from thumper.navigation.options import NavigationOptions
from thumper.navigation.planners.astar import AStarPlanner
from thumper.navigation.planners.traversal_cost import TraversalCostOptions
from thumper.navigation.speed_limits import SpeedLimits
from thumper_hil.kinematic.closed_loop import Conditions, drive
from thumper_hil.kinematic.maps import read_pgm
from thumper_hil.kinematic.world import KinematicWorld, box

NO_HITS = np.empty((0, 2))


def written(folder: Path, mode: str, pixels: list[list[int]]) -> Path:
    """Write a mask whose first row of pixels is the largest y."""
    (folder / "mask.pgm").write_bytes(encode_pgm(np.array(pixels, np.uint8)))
    ends = (
        "occupied_thresh: 0.65\nfree_thresh: 0.25"
        if mode == "trinary"
        else "occupied_thresh: 1.0\nfree_thresh: 0.0"
    )
    text = f"image: mask.pgm\nmode: {mode}\nresolution: 0.5\norigin: [-1.0, 2.0, 0]\nnegate: 0\n{ends}\n"
    path = folder / "mask.yaml"
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    ("mode", "cells"),
    [
        ("trinary", [100, -1, 0, 0]),  # darknesses 1.0, 0.502, 0.196 and 0.004
        ("scale", [100, 50, 20, 0]),
        ("raw", [0, -1, -1, -1]),  # the pixels themselves; above 100 they are unknown
    ],
)
def test_mask_modes(tmp_path: Path, mode: str, cells: list[int]) -> None:
    assert load_mask(written(tmp_path, mode, [[0, 127, 205, 254]])).cells.tolist() == [cells]


def test_raw_values_are_percentages(tmp_path: Path) -> None:
    assert load_mask(written(tmp_path, "raw", [[0, 30, 100, 101]])).cells.tolist() == [[0, 30, 100, -1]]


@pytest.mark.parametrize(
    ("change", "message"),
    [(("mode: scale", "mode: grey"), "grey"), (("origin: [-1.0, 2.0, 0]", "origin: 3"), "origin")],
)
def test_invalid_mask_is_named(tmp_path: Path, change: tuple[str, str], message: str) -> None:
    path = written(tmp_path, "scale", [[0]])
    path.write_text(path.read_text().replace(*change))
    with pytest.raises(ThumperError, match=message) as caught:
        load_masks(CostmapFilterOptions(speed=str(path)))
    assert str(path) in str(caught.value)
    assert caught.value.exit_code == 2
    with pytest.raises(ThumperError, match="cannot be read"):
        load_masks(CostmapFilterOptions(keepout=str(tmp_path / "none.yaml")))


def test_depot_masks_have_the_values_of_their_pixels(nav_data: Path) -> None:
    """Against the rule written again: darkness (255 - pixel) / 255, row 0 of the image on top."""
    maps = nav_data / "ros_maps"
    dark = (255.0 - read_pgm(maps / "depot_speed.pgm")) / 255.0
    assert (load_mask(maps / "depot_speed.yaml").cells == np.rint(100.0 * dark)).all()
    assert np.unique(load_mask(maps / "depot_speed.yaml").cells).tolist() == [0, 20, 25, 50, 100]
    black = read_pgm(maps / "depot_keepout.pgm") == 0
    assert ((load_mask(maps / "depot_keepout.yaml").cells == 100) == black).all()


def test_mask_of_another_size_and_resolution_is_aligned(tmp_path: Path) -> None:
    mask = load_mask(written(tmp_path, "trinary", [[254, 0], [254, 254]]))  # closed: x -0.5 to 0, y 2.5 to 3
    grid = OccupancyGrid(cells=np.zeros((30, 40), np.int8), resolution_m=0.1, origin_x_m=-2.0, origin_y_m=1.0)
    rows, cols = np.nonzero(keepout_cells((mask,), grid))
    assert (rows.min(), rows.max(), cols.min(), cols.max()) == (15, 19, 15, 19)
    assert len(rows) == 25
    costmap = build_costmap(grid, NO_HITS, Footprint(), CostmapOptions(), (mask,))
    assert ((costmap.costs == LETHAL) == keepout_cells((mask,), grid)).all()
    assert not keepout_cells((), grid).any()


def test_speed_fractions_of_places(tmp_path: Path) -> None:
    mask = load_mask(written(tmp_path, "scale", [[254, 127], [205, 0]]))
    places_m = np.array(((-0.75, 2.75), (-0.25, 2.75), (-0.75, 2.25), (-0.25, 2.25), (9.0, 9.0)))
    assert speed_fractions((mask,), places_m) == pytest.approx([1.0, 0.5, 0.8, 0.0, 1.0])


def test_speed_limit_falls_before_the_zone(tmp_path: Path) -> None:
    """The zone of 50 % begins at x = -0.5; from 0.4 m/s braking to 0.2 m/s takes 0.08 + 0.15 m."""
    mask = load_mask(written(tmp_path, "scale", [[254, 127], [254, 127]]))
    limits = SpeedLimits(v_max_m_s=0.4, v_accel_m_s2=0.4, latency_s=0.2)
    limiter = SpeedLimiter(limits, approach_m_s=0.06, masks=(mask,))
    x_m = np.arange(-0.99, -0.01, 0.005)
    path_m = np.column_stack((x_m, np.full(x_m.size, 2.5)))
    found = [limiter.limit_m_s(Pose2(x_m=float(x), y_m=2.5), path_m[i:], math.inf) for i, x in enumerate(x_m)]
    exact = np.minimum(0.4, np.sqrt(0.08**2 + 0.2**2 + 0.8 * np.maximum(0.0, -0.5 - x_m)) - 0.08)
    exact = np.where(x_m > -0.5, 0.2, np.maximum(exact, 0.2))
    assert found == pytest.approx(exact, abs=0.006)
    assert SpeedLimiter(limits, approach_m_s=0.06).limit_m_s(Pose2(), path_m, math.inf) == 0.4
    black = load_mask(written(tmp_path, "scale", [[0, 0], [0, 0]]))
    assert SpeedLimiter(limits, approach_m_s=0.06, masks=(black,)).limit_m_s(
        Pose2(x_m=-0.5, y_m=2.5), None, math.inf
    ) == pytest.approx(0.06)


def test_depot_plans_avoid_the_keepout_zones(nav_data: Path) -> None:
    """No path between the recorded pairs enters the mask; the planner reports pairs without a path."""
    maps, options = nav_data / "ros_maps", CostmapOptions()
    grid, keepout = load_map(maps / "depot.yaml"), load_mask(maps / "depot_keepout.yaml")
    planner = AStarPlanner(TraversalCostOptions(allow_unknown=False))
    masked = build_costmap(grid, NO_HITS, Footprint(), options, (keepout,))
    free = build_costmap(grid, NO_HITS, Footprint(), options)
    longer = rejected = 0
    for start_col, start_row, goal_col, goal_row, *_ in np.loadtxt(
        nav_data / "bench" / "depot_pairs.csv", delimiter=",", skiprows=1
    ):
        start = Pose2(x_m=0.05 * (start_col + 0.5), y_m=0.05 * (start_row + 0.5))
        goal = Goal(x_m=0.05 * (goal_col + 0.5), y_m=0.05 * (goal_row + 0.5))
        path_m = planner.plan(masked, start, goal).path_m
        if path_m is None:
            rejected += 1
            continue
        rows, cols = masked.cells_of(path_m[1:])  # a robot inside the zone may leave it
        assert not keepout_cells((keepout,), grid)[rows, cols].any()
        whole_m = planner.plan(free, start, goal).path_m
        assert whole_m is not None
        longer += planner.path_cost_m(masked, path_m) > planner.path_cost_m(free, whole_m) + 0.2
    assert longer > 0
    assert rejected < 50


ROOM, AREA = KinematicWorld.from_boxes(box(0.8, 0.0, 4.8, 3.8)), (-4.2, -5.0, 10.0, 10.0)
START, GOAL = Pose2(x_m=1.73, y_m=0.08, theta_rad=math.pi), Goal(x_m=-0.49, y_m=0.02)


def saved(folder: Path, closed: tuple[slice, slice]) -> str:
    """Save a mask of the room with some cells set; 5 cm cells from (-2, -2)."""
    cells = np.zeros((80, 120), np.int8)
    cells[closed] = 100
    path = folder / "zone.yaml"
    save_map(OccupancyGrid(cells=cells, resolution_m=0.05, origin_x_m=-2.0, origin_y_m=-2.0), path)
    return str(path)


def test_drive_avoids_a_keepout_zone(tmp_path: Path) -> None:
    """A zone from x = 0.4 to 0.8, y = -0.5 to 2 crosses the path: the footprint stays out of it."""
    options = NavigationOptions(masks=CostmapFilterOptions(keepout=saved(tmp_path, np.s_[30:80, 48:56])))
    exact = Conditions(pose_noise_m=0.0, pose_noise_rad=0.0)
    run = drive(ROOM, START, GOAL, AREA, options=options, conditions=exact)
    assert run.state is NavigationState.REACHED, run.reason
    zone = KinematicWorld.from_boxes(box(0.6, 0.75, 0.4, 2.5))
    assert min(zone.clearance_m(pose, Footprint()) for pose in run.track) > 0.0


def test_drive_is_slow_in_a_slow_zone(tmp_path: Path) -> None:
    """Half speed between x = 0.2 and 1.0; full speed is reached outside of it."""
    path = Path(saved(tmp_path, np.s_[:, 44:60]))
    path.write_text(path.read_text().replace("0.65", "1.0").replace("0.196", "0.0") + "mode: scale\n")
    image = path.with_suffix(".pgm")
    pixels = np.full((80, 120), 254, np.uint8)
    pixels[:, 44:60] = 127
    image.write_bytes(encode_pgm(pixels))
    masks = CostmapFilterOptions(speed=str(path))
    run = drive(ROOM, START, GOAL, AREA, options=replace(NavigationOptions(), masks=masks))
    assert run.state is NavigationState.REACHED, run.reason
    commanded = [
        (pose.x_m, output.command.v_m_s) for pose, output in zip(run.track, run.outputs, strict=True)
    ]
    assert max(v for x, v in commanded if 0.25 < x < 0.95) <= 0.2 + 1e-9
    assert max(v for x, v in commanded if x > 1.1) > 0.3
