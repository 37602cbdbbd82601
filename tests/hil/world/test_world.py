"""Test the world's rays, contacts and ground-truth grid against closed forms and a simple reference."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thumper.common.errors import ThumperError
from thumper.common.geometry import FloatArray, Pose2
from thumper.maps.occupancy_grid import OCCUPIED
from thumper_hil.bench.collision import FOOTPRINT_M
from thumper_hil.world.world import World

NO_CIRCLES = np.zeros((0, 3))
SQUARE = World(
    segments_m=np.array([[-1.0, -1, 1, -1], [1, -1, 1, 1], [1, 1, -1, 1], [-1, 1, -1, -1]]),
    circles_m=NO_CIRCLES,
)


def reference_cast(world: World, x_m: float, y_m: float, angle_rad: float) -> float:
    """Solve origin + t d = a + u (b - a) by Cramer's rule, and the circle's quadratic equation."""
    dx, dy = math.cos(angle_rad), math.sin(angle_rad)
    found = [math.inf]
    for x0, y0, x1, y1 in world.segments_m.tolist():
        ex, ey = x1 - x0, y1 - y0
        determinant = dy * ex - dx * ey
        if abs(determinant) < 1e-12:
            continue
        t = (ex * (y0 - y_m) - ey * (x0 - x_m)) / determinant
        u = (dx * (y0 - y_m) - dy * (x0 - x_m)) / determinant
        if t >= 0.0 and -1e-12 <= u <= 1.0 + 1e-12:
            found.append(t)
    for cx, cy, radius in world.circles_m.tolist():
        half_b, c = dx * (x_m - cx) + dy * (y_m - cy), (x_m - cx) ** 2 + (y_m - cy) ** 2 - radius**2
        roots = np.roots([1.0, 2.0 * half_b, c])
        found += [float(root.real) for root in roots if abs(root.imag) < 1e-12 and root.real >= 0.0]
    return min(found)


@settings(max_examples=40, deadline=None)  # the first call may compile
@given(seed=st.integers(0, 2**31))
def test_rays_match_the_reference(seed: int) -> None:
    rng = np.random.default_rng(seed)
    circles = np.column_stack([rng.uniform(-3, 3, (4, 2)), rng.uniform(0.05, 0.8, 4)])
    world = World(segments_m=rng.uniform(-3, 3, (12, 4)), circles_m=circles)
    x_m, y_m, angles = rng.uniform(-3, 3, 40), rng.uniform(-3, 3, 40), rng.uniform(-4, 4, 40)
    expected = [reference_cast(world, *ray) for ray in zip(x_m, y_m, angles, strict=True)]
    np.testing.assert_allclose(world.cast(x_m, y_m, angles), expected, rtol=1e-7, atol=1e-9)


def test_ranges_in_a_square_match_the_closed_form() -> None:
    angles = np.linspace(-math.pi, math.pi, 721)
    expected = 1.0 / np.maximum(np.abs(np.cos(angles)), np.abs(np.sin(angles)))
    np.testing.assert_allclose(SQUARE.cast(0.0, 0.0, angles), expected, rtol=1e-12)


def test_no_ray_escapes_through_a_corner() -> None:
    """A ray aimed at the corner of two walls hits one of them, whatever the rounding."""
    rng = np.random.default_rng(1)
    turns = np.arange(40) * math.tau / 40
    corners = rng.uniform(1.0, 3.0, (40, 1)) * np.column_stack([np.cos(turns), np.sin(turns)])
    ring = World(segments_m=np.hstack([corners, np.roll(corners, -1, axis=0)]), circles_m=NO_CIRCLES)
    origins = rng.uniform(-0.5, 0.5, (200_000, 2))
    aims = corners[rng.integers(0, 40, 200_000)] - origins
    assert np.isfinite(ring.cast(origins[:, 0], origins[:, 1], np.arctan2(aims[:, 1], aims[:, 0]))).all()


def test_ray_along_a_wall_hits_its_nearer_end() -> None:
    wall = World(segments_m=np.array([[3.0, 0.0, 1.0, 0.0]]), circles_m=NO_CIRCLES)
    np.testing.assert_allclose(wall.cast(0.0, 0.0, [0.0, math.pi]), [1.0, math.inf])
    assert wall.cast(2.0, 0.0, 0.0)[0] == 0.0, "an origin on the wall"
    assert wall.cast(0.0, 0.1, 0.0)[0] == math.inf, "parallel to it"


def test_circle_is_hit_from_outside_and_inside_not_behind() -> None:
    post = World(segments_m=np.zeros((0, 4)), circles_m=np.array([[2.0, 0.0, 0.5]]))
    np.testing.assert_allclose(
        post.cast([0.0, 2.0, 4.0, 0.0], 0.0, [0.0, 0.0, 0.0, 1.0]), [1.5, 0.5, math.inf, math.inf]
    )


def test_clearance_and_contact_match_the_closed_form() -> None:
    assert SQUARE.clearance_m(Pose2(), FOOTPRINT_M) == pytest.approx(1.0 - 0.21)
    assert SQUARE.clearance_m(Pose2(theta_rad=math.pi / 2), FOOTPRINT_M) == pytest.approx(1.0 - 0.21)
    assert SQUARE.clearance_m(Pose2(y_m=0.5), FOOTPRINT_M) == pytest.approx(0.5 - 0.15)
    assert not SQUARE.touches(Pose2(x_m=0.789), FOOTPRINT_M)
    assert SQUARE.touches(Pose2(x_m=0.791), FOOTPRINT_M)
    diagonal_m = math.hypot(0.21, 0.15)
    angle_rad = math.atan2(0.15, 0.21)  # this rotation points a corner straight at the wall
    corner_first = Pose2(theta_rad=-angle_rad)
    assert SQUARE.clearance_m(corner_first, FOOTPRINT_M) == pytest.approx(1.0 - diagonal_m)


@pytest.mark.parametrize("radius_m", [0.01, 0.05, 3.0])
def test_object_inside_or_around_the_footprint_is_a_contact(radius_m: float) -> None:
    post = World(segments_m=np.zeros((0, 4)), circles_m=np.array([[0.02, 0.0, radius_m]]))
    assert post.touches(Pose2(), FOOTPRINT_M)
    nail = World(segments_m=np.array([[0.0, 0.0, 0.01, 0.0]]), circles_m=NO_CIRCLES)
    assert nail.touches(Pose2(), FOOTPRINT_M)


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**31))
def test_clearance_matches_dense_sampling(seed: int) -> None:
    rng = np.random.default_rng(seed)
    world = World(segments_m=rng.uniform(-2, 2, (3, 4)), circles_m=np.array([[*rng.uniform(-2, 2, 2), 0.2]]))
    pose = Pose2(x_m=rng.uniform(-2, 2), y_m=rng.uniform(-2, 2), theta_rad=rng.uniform(-3, 3))
    share = np.linspace(0.0, 1.0, 401)[:, None]
    seen = [segment[:2] + share * (segment[2:] - segment[:2]) for segment in world.segments_m]
    turn = np.linspace(0.0, math.tau, 2001)
    x_m, y_m, radius_m = world.circles_m[0]
    seen.append(np.column_stack([x_m + radius_m * np.cos(turn), y_m + radius_m * np.sin(turn)]))
    in_body = pose.inverse().apply(np.vstack(seen))
    outside = np.maximum(np.abs(in_body) - (0.21, 0.15), 0.0)  # the rectangle's own distance function
    sampled_m = float(np.hypot(outside[:, 0], outside[:, 1]).min())
    inside_circle = math.hypot(pose.x_m - x_m, pose.y_m - y_m) < radius_m
    expected_m = 0.0 if inside_circle else sampled_m
    assert world.clearance_m(pose, FOOTPRINT_M) == pytest.approx(expected_m, abs=0.006)


def clearance_of_point(world: World, point_m: tuple[float, float]) -> float:
    return world.clearance_m(
        Pose2(x_m=point_m[0], y_m=point_m[1]), np.array([[0.0, 0.0], [1e-9, 0.0], [0.0, 1e-9]])
    )


def line(start: tuple[float, float], end: tuple[float, float]) -> FloatArray:
    return np.linspace(start, end, 100)


def test_lab_has_room_for_both_missions() -> None:
    lab, lab_box = World.load("lab"), World.load("lab_box")
    for point in [(1.73, 0.08), (-0.49, 0.02), (2.05, 0.64), (0.38, -0.45)]:
        assert clearance_of_point(lab, point) >= 0.6
    for point in [(2.05, 0.64), (0.38, -0.45)]:
        assert clearance_of_point(lab_box, point) >= 0.6
    assert min(clearance_of_point(lab, (x, y)) for x, y in line((1.73, 0.08), (-0.49, 0.02))) >= 0.5
    assert any(
        lab_box.touches(Pose2(x_m=x, y_m=y), FOOTPRINT_M) for x, y in line((2.05, 0.64), (0.38, -0.45))
    ), "the box blocks the straight line"
    assert np.isfinite(lab.cast(0.5, 0.0, np.linspace(-math.pi, math.pi, 5000))).all(), "the room is closed"


def test_both_sides_of_the_box_are_wide_enough() -> None:
    """From the ends of the box, across the line, the next obstacle is at least 0.7 m away."""
    lab = World.load("lab")
    across_rad = math.radians(33.1 + 90.0)
    for side in (1.0, -1.0):
        x_m, y_m = 1.215 + side * 0.2 * math.cos(across_rad), 0.095 + side * 0.2 * math.sin(across_rad)
        assert lab.cast(x_m, y_m, across_rad + (0.0 if side > 0 else math.pi))[0] >= 0.7


@pytest.mark.parametrize("resolution_m", [0.05, 0.03])
def test_grid_matches_the_world(resolution_m: float) -> None:
    world = World.load("lab_box")
    grid = world.to_grid(resolution_m)
    assert grid.cells[grid.cell_of(1.215, 0.095)] == OCCUPIED, "the middle of the box, 0.15 m from its sides"
    for row, column in np.random.default_rng(1).integers((0, 0), grid.cells.shape, (400, 2)):
        x_m, y_m = grid.centre_of(int(row), int(column))
        near_m = clearance_of_point(world, (x_m, y_m))
        if near_m < 0.5 * resolution_m - 1e-6:
            assert grid.cells[row, column] == OCCUPIED
        if near_m > 0.71 * resolution_m and grid.cells[row, column] == OCCUPIED:
            assert any(_inside(box, x_m, y_m) for box in world.boxes_m)


def _inside(box_m: FloatArray, x_m: float, y_m: float) -> bool:
    """Compare the areas of the four triangles between point and sides with the area of the box."""
    spokes = box_m - (x_m, y_m)
    following = np.roll(spokes, -1, axis=0)
    areas = 0.5 * np.abs(spokes[:, 0] * following[:, 1] - spokes[:, 1] * following[:, 0])
    length_m, width_m = np.hypot(*(box_m[1] - box_m[0])), np.hypot(*(box_m[2] - box_m[1]))
    return bool(areas.sum() <= length_m * width_m + 1e-9)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[[box]]\nx_m=0\ny_m=0\nlength_m=1\nwidth_m=1\nheight_m=2\n", "box[0].height_m"),
        ("[[box]]\nx_m=0\ny_m=0\nlength_m=1\nwidth_m=1\ncolour=[1, 2]\n", "box[0].colour = [1, 2]: give"),
        (
            "[[box]]\nx_m=0\ny_m=0\nlength_m=1\nwidth_m=1\ncolour=[1, 2, 3]\nfrom_s=1\n",
            "box[0].colour: a box that comes or goes has none",
        ),
        ("[[wal]]\npoints_m=[[0,0],[1,1]]\n", "wal"),
        ("[[circle]]\nx_m=0\ny_m=0\n", "circle[0].radius_m: missing"),
        ("[[circle]]\nx_m=0\ny_m=0\nradius_m=-1\n", "circle[0].radius_m = -1.0: must be above 0"),
        ("[[circle]]\nx_m=true\ny_m=0\nradius_m=1\n", "circle[0].x_m = True"),
        ("[[wall]]\npoints_m=[[0,0]]\n", "wall[0].points_m"),
        ("[[wall]]\npoints_m=[[0,0],[1,nan]]\n", "wall[0].points_m"),
        ("[[wall]]\npoints_m=[[0,0],[1,1]]\nclosed=1\n", "wall[0].closed"),
        ("[box]\nx_m=0\n", "write each entry as [[box]]"),
        ("", "the world is empty"),
        ("base='w'\n", "includes itself"),
        ("base='nowhere'\n", "unknown world; choose from: "),
        ("[[box\n", "cannot read the world"),
    ],
)
def test_invalid_world_file_is_reported_with_its_key(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "w.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ThumperError) as caught:
        World.load(path)
    assert message in str(caught.value)
    assert str(tmp_path) in str(caught.value)
