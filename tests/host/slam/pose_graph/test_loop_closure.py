"""Loops too long for a scan matcher alone."""

from typing import cast

import numpy as np
import pytest
from benchmarks.shared.corridors import corridor_loop, drive, errors_m, round_trip

from tests.variants import some_of
from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.lidar.deskew import HIT, MISS, ScanPoints
from thumper.maps.occupancy_grid import FREE
from thumper.slam.factory import MappingOptions, Method, make_mapper
from thumper.slam.grid.branch_and_bound import BranchAndBoundSearch, SearchField
from thumper.slam.grid.growing_grid import HitGrid
from thumper.slam.grid.options import GridMapperOptions
from thumper.slam.mapper import Mapper
from thumper.slam.pose_graph.graph_mapper import GraphMapper
from thumper.slam.pose_graph.loop_closure import LoopOptions, LoopSearch
from thumper.slam.pose_graph.loop_hypotheses import Closure
from thumper.slam.pose_graph.optimizer import Edge, Solver, factor, residual, substitute
from thumper.slam.pose_graph.submaps import ODOMETRY_STD_M, ODOMETRY_STD_RAD, SubmapGraph

LENGTH_M, BREADTH_M = 32.0, 20.0


BEYOND_M = 20.0  # driven on after one round


def mapped(mapper: Mapper, seed: int) -> list[Pose2]:
    """Drive around the corridors and return the true poses."""
    rng = np.random.default_rng(seed)
    world, poses = corridor_loop(LENGTH_M, BREADTH_M, rng), round_trip(LENGTH_M, BREADTH_M, BEYOND_M)
    for odometry, scan in drive(world, poses, rng):
        mapper.update(odometry, scan, Twist2())
    return poses


@pytest.mark.slow
@pytest.mark.parametrize("seed", some_of([1, 2]))
def test_corridor_loop_of_ninety_metres_closes(seed: int) -> None:
    start = round_trip(LENGTH_M, BREADTH_M, 0.0)[0]
    mapper = GraphMapper(loops=LoopOptions(active_m=30.0), map_from_base=start)
    poses = mapped(mapper, seed)
    found = mapper.path()
    revisited = round(BEYOND_M / 0.2)
    # Where the loop closes: the same place, visited at the start and at the end.
    for first, last in ((revisited - 5, -5), (revisited - 15, -15)):
        apart = np.hypot(*(found[last, :2] - found[first, :2]))
        true = poses[last].distance_m(poses[first])
        assert abs(apart - true) < 0.1
    assert mapper.loops_closed >= 1
    assert errors_m(found, poses).max() < 1.5


def square(drift: float) -> tuple[np.ndarray[tuple[int, int], np.dtype[np.float64]], list[Edge]]:
    """Return four sides of 10 m whose corners turn too far, and the true edge that closes them."""
    step = Pose2(x_m=10.0, theta_rad=np.pi / 2 + drift)
    poses, edges = [Pose2()], []
    for k in range(4):
        poses.append(poses[-1] @ step)
        edges.append(_edge(k, k + 1, step, loop=False))
    edges.append(_edge(0, 4, Pose2(), loop=True))
    return np.array([(p.x_m, p.y_m, p.theta_rad) for p in poses]), edges


def optimize(poses: FloatArray, edges: list[Edge]) -> FloatArray:
    solver = Solver(poses, edges)
    while not solver.run_part():
        pass
    return solver.poses


def _edge(first: int, second: int, relative: Pose2, *, loop: bool) -> Edge:
    std = 0.005 if loop else 0.05
    return Edge(
        first=first,
        second=second,
        first_from_second=relative,
        information=np.eye(3) / std**2,
        loop=loop,
        length_m=1.0,
    )


def test_optimizer_makes_a_bent_square_square() -> None:
    poses, edges = square(0.02)
    assert residual(poses, edges[-1])[0] > 0.3
    found = optimize(poses, edges)
    assert residual(found, edges[-1])[0] < 0.02
    np.testing.assert_allclose(found[0], 0.0, atol=1e-6)
    np.testing.assert_allclose(found[2, :2], (10.0, 10.0), atol=0.2)


def test_closure_far_from_the_drift_is_not_held_back() -> None:
    """The robust kernel alone would leave a gap of 3.7 m of these 5 m."""
    poses, edges = square(0.2)
    assert residual(poses, edges[-1])[0] > 5.0
    assert residual(optimize(poses, edges), edges[-1])[0] < 0.02


def test_drift_flows_along_a_corridor() -> None:
    """The same drift, in a room all around and in a corridor without a wall across it."""
    angles = np.linspace(-np.pi, np.pi, 361)[:-1]
    sides = {
        "room": 4.0 / np.maximum(np.abs(np.cos(angles)), np.abs(np.sin(angles))),
        "corridor": np.minimum(20.0, 1.0 / np.maximum(np.abs(np.sin(angles)), 1e-9)),
    }
    stds_m = {}
    for name, ranges_m in sides.items():
        ends_m = ranges_m[:, np.newaxis] * np.column_stack((np.cos(angles), np.sin(angles)))
        kinds = np.where(ranges_m < 20.0, HIT, MISS).astype(np.uint8)
        points = ScanPoints(origins_m=np.zeros_like(ends_m), ends_m=ends_m, kinds=kinds)
        submaps = SubmapGraph()
        for step in range(26):
            submaps.add(Pose2(y_m=0.1 * step, theta_rad=0.5 * np.pi), points)
        stds_m[name] = np.sqrt(np.diag(np.linalg.inv(submaps.edges[0].information)))
    np.testing.assert_allclose(stds_m["room"], (ODOMETRY_STD_M, ODOMETRY_STD_M, ODOMETRY_STD_RAD), rtol=0.01)
    assert 0.09 < stds_m["corridor"][0] < 0.11  # 5 % of 2 m, ahead
    np.testing.assert_allclose(stds_m["corridor"][1:], stds_m["room"][1:], rtol=0.05)


@pytest.mark.parametrize(("leads", "closed_at"), [((0.2, 0.2), 1), ((0.1, 0.1, 0.15), 2), ((0.3, 0.05), 1)])
def test_loop_closes_once_agreeing_closures_lead_clearly(leads: tuple[float, ...], closed_at: int) -> None:
    """Doorways that repeat: the wrong pose explains little more than the next one, several times in a row."""
    submaps = SubmapGraph()
    point = ScanPoints(origins_m=np.zeros((1, 2)), ends_m=np.ones((1, 2)), kinds=np.full(1, HIT, np.uint8))
    for step in range(60):
        submaps.add(Pose2(x_m=0.5 * step), point)
    search = LoopSearch(GridMapperOptions(), LoopOptions(), submaps)
    for number, lead in enumerate(leads):
        new = 10 + number
        found = Closure(old=number, new=new, old_from_new=Pose2(), shift=Pose2(y_m=1.0), lead=lead)
        assert search.accept(new, found) == (number == closed_at)


@pytest.mark.parametrize("name", ["", "slam", "graph"])
def test_default_mapper_closes_loops(name: str) -> None:
    options = MappingOptions(method=cast("Method", name)) if name else MappingOptions()
    assert isinstance(make_mapper(options), GraphMapper)


@pytest.mark.parametrize(("drift_m", "connected"), [(0.0, True), (1.2, False)])
def test_drifted_submap_is_not_taken_for_its_old_neighbour(drift_m: float, connected: bool) -> None:
    """Out and back along a corridor: beyond the matcher's basin, only a search knows the relative pose."""
    along_m = np.arange(-5.0, 20.0, 0.05)
    walls_m = np.concatenate([np.column_stack((along_m, 0.0 * along_m + y_m)) for y_m in (-1.5, 1.5)])
    submaps = SubmapGraph()
    for x_m in (*np.arange(0.0, 15.0, 0.25), *np.arange(15.0, 0.0, -0.25)):
        pose = Pose2(x_m=float(x_m), y_m=drift_m if submaps.driven_m > 15.0 else 0.0)
        ends_m = walls_m[np.abs(walls_m[:, 0] - x_m) < 4.0] - (x_m, 0.0)
        kinds = np.full(len(ends_m), HIT, np.uint8)
        points = ScanPoints(origins_m=np.zeros_like(ends_m), ends_m=ends_m, kinds=kinds)
        if submaps.add(pose, points):
            submaps.connect_to_nearest(submaps.within(120.0), 0.6)
    assert any(edge.loop for edge in submaps.edges) == connected


def test_optimizer_keeps_consistent_poses() -> None:
    poses, edges = square(0.0)
    np.testing.assert_allclose(optimize(poses, edges)[:, :2], poses[:, :2], atol=1e-6)


def test_loop_closure_is_spread_over_scans(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The robot keeps driving, so no update may rebuild the whole map. In the end grid and path agree."""
    start = round_trip(LENGTH_M, BREADTH_M, 0.0)[0]
    mapper = GraphMapper(loops=LoopOptions(active_m=30.0), map_from_base=start)
    inserted: list[int] = []
    insert = HitGrid.insert

    def counted(grid: HitGrid, map_from_base: Pose2, points: ScanPoints) -> None:
        inserted[-1] += 1
        insert(grid, map_from_base, points)

    monkeypatch.setattr(HitGrid, "insert", counted)
    rng = np.random.default_rng(1)
    world, poses = corridor_loop(LENGTH_M, BREADTH_M, rng), round_trip(LENGTH_M, BREADTH_M, 12.0)
    for odometry, scan in drive(world, poses, rng):
        inserted.append(0)
        mapper.update(odometry, scan, Twist2())
    assert mapper.loops_closed >= 1
    # A scan every 0.2 to 0.3 m: up to three parts of the rebuilt map, and of the map that is searched. A part
    # inserts scans of 3 m and 121 beams until they have crossed 100,000 cells.
    assert 6 < max(inserted) <= 6 * 20
    inserted.append(0)
    path = mapper.path()
    grid = mapper.grid()
    cells = [grid.cells[grid.cell_of(x, y)] for x, y, _ in path]
    assert np.mean(np.array(cells) == FREE) > 0.97
    assert errors_m(path, poses).max() < 1.5


def test_pose_follows_the_map_through_a_loop_closure() -> None:
    """Only the scan that closes the loop reports a jump, and no pose refers to the map before it."""
    start = round_trip(LENGTH_M, BREADTH_M, 0.0)[0]
    mapper = GraphMapper(loops=LoopOptions(active_m=30.0), map_from_base=start)
    rng = np.random.default_rng(1)
    world, poses = corridor_loop(LENGTH_M, BREADTH_M, rng), round_trip(LENGTH_M, BREADTH_M, 12.0)
    drives = list(drive(world, poses, rng))
    jumps = 0
    for odometry, scan in drives + 100 * drives[-1:]:  # stationary at the end while the map is rebuilt
        update = mapper.update(odometry, scan, Twist2())
        assert update.map_from_base.distance_m(mapper.map_from_odom @ odometry) < 1e-9
        jumps += update.jumped
    assert jumps == mapper.loops_closed == 1


def test_search_in_parts_equals_search_at_once() -> None:
    """An L-shaped wall, searched for 1.5 m and 0.2 rad from its true pose."""
    along = np.arange(0.0, 6.0, 0.05)
    walls_m = np.concatenate(
        (np.column_stack((along, 0.0 * along)), np.column_stack((0.0 * along, 0.5 * along)))
    )
    apart_m = np.linalg.norm(walls_m[:, np.newaxis, np.newaxis] - lattice_m(), axis=-1).min(axis=0)
    field = SearchField(np.minimum(apart_m, 0.5).astype(np.float32), 0.05, (-1.0, -1.0), 0.15)
    true = Pose2(x_m=2.0, y_m=1.0, theta_rad=0.2)
    points_m, centre = true.inverse().apply(walls_m), Pose2(x_m=3.0, y_m=2.0)
    whole, parts = (BranchAndBoundSearch(field, points_m, centre, 2.0, 0.4) for _ in range(2))
    assert whole.run(None)
    steps = 1
    while not parts.run(200_000):
        steps += 1
    assert steps > 5
    assert parts.result() == whole.result()
    assert whole.result().pose.distance_m(true) < 0.15
    assert whole.result().score > 0.85


def lattice_m() -> FloatArray:
    """Return the cell centres of a map of 8 x 6 m with its corner at (-1, -1), shape (rows, columns, 2)."""
    x_m, y_m = np.meshgrid(np.arange(160) * 0.05 - 0.975, np.arange(120) * 0.05 - 0.975)
    return np.stack((x_m, y_m), axis=-1)


def test_factorization_in_parts_solves_the_system() -> None:
    rng, n, width = np.random.default_rng(1), 40, 7
    lower = np.tril(np.triu(rng.standard_normal((n, n)), -width)) + 5.0 * np.eye(n)
    matrix, right = lower @ lower.T, rng.standard_normal(n)
    band = np.zeros((n, width + 1))
    for below in range(width + 1):
        band[below:, width - below] = np.diagonal(matrix, -below)
    for first in range(0, n, 11):
        factor(band, first, min(n, first + 11))
    found = right.copy()
    substitute(band, found)
    np.testing.assert_allclose(found, np.linalg.solve(matrix, right), rtol=1e-9)


def test_old_submaps_join_the_active_map_as_they_come_near() -> None:
    """If they joined only when the map is trimmed, the robot would drive past them on a second map."""
    start, active_m = round_trip(LENGTH_M, BREADTH_M, 0.0)[0], 30.0
    mapper = GraphMapper(loops=LoopOptions(active_m=active_m), map_from_base=start)
    rng = np.random.default_rng(1)
    world, poses = corridor_loop(LENGTH_M, BREADTH_M, rng), round_trip(LENGTH_M, BREADTH_M, 50.0)
    missing: list[int] = []
    closed_at = len(poses)
    for number, (odometry, scan) in enumerate(drive(world, poses, rng)):
        mapper.update(odometry, scan, Twist2())
        if mapper.loops_closed and closed_at == len(poses):
            closed_at = number
        if number > closed_at + 50:  # the map is rebuilt by then
            missing.append(len(mapper.submaps.within(active_m).keys() - mapper._active))
    assert len(missing) > 100
    assert np.mean(missing) < 4.0


def test_the_front_end_leaves_the_torn_map_soon_after_a_loop_closure() -> None:
    """Where both rounds lie in one map, a match slides along equal doorways: no way to drive for long."""
    start = round_trip(LENGTH_M, BREADTH_M, 0.0)[0]
    mapper = GraphMapper(loops=LoopOptions(active_m=60.0), map_from_base=start)
    rng = np.random.default_rng(1)
    world, poses = corridor_loop(LENGTH_M, BREADTH_M, rng), round_trip(LENGTH_M, BREADTH_M, 60.0)
    scans_in_old_map, missing = 0, list[int]()
    for odometry, scan in drive(world, poses, rng):
        mapper.update(odometry, scan, Twist2())
        if mapper.loops_closed:
            scans_in_old_map += mapper._next_active is not None and mapper._graph_from_front_end != Pose2()
            missing.append(len(mapper.submaps.within(60.0).keys() - mapper._active))
    assert mapper.loops_closed == 1
    assert scans_in_old_map < 11  # 13 if the whole map is rebuilt first; 26 at the usual pace, too
    assert max(missing[30:]) == 0  # the submaps left out at first have followed
