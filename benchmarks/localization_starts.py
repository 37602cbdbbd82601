"""What becomes of a start that a person names: right, rough, half a turn round, anywhere, or none at all.

Run: python benchmarks/localization_starts.py [--starts N] [--moved M]
Simulated places and a lidar of 4 m and 240 degrees; M boxes stand there that the map does not know. After the
first scan the pose is right (0.15 m, 0.1 rad), in doubt (the robot stands, and says so), or wrongly believed;
and again after a drive of 14 steps of 0.1 m.
"""

import argparse
import math
import sys
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.figure import figure

from tests.host.slam.rooms import ROOM, rectangle
from thumper.common.geometry import FloatArray, Pose2, Twist2, wrap_angle
from thumper.lidar.scan import Scan
from thumper.maps.occupancy_grid import FREE, OccupancyGrid
from thumper.slam.localization.amcl import Amcl
from thumper_hil.world.world import World

RANGE_M, OPENING_RAD, BEAMS, NOISE_M = 4.0, math.radians(240), 240, 0.015
STEPS = 14
Judged = Counter[str]


def box(x_m: float, y_m: float, width_m: float, height_m: float) -> FloatArray:
    """Four walls round a middle."""
    return rectangle(x_m - width_m / 2, y_m - height_m / 2, x_m + width_m / 2, y_m + height_m / 2)


DESKS = (box(-1.5, 0, 1.2, 0.6), box(1.5, 0, 1.2, 0.6), box(-2.7, 2.2, 0.6, 0.6), box(2.8, -1.5, 0.4, 1.0))
NICHES = (box(-3, 1, 0.8, 0.3), box(3.3, -1, 0.8, 0.3), box(5, 1, 0.5, 0.4))
DOORS = np.array([[0, -3, 0, -0.5], [0, 0.5, 0, 3], [4, -3, 4, 1], [4, 2, 4, 3.0]])
BENCHES = (box(-2, 2.5, 1, 0.8), box(2, -2.4, 0.6, 0.8), box(6, 0, 0.8, 0.8))
PLACES = {
    "room 5 x 4 m": ROOM,
    "hall 8 x 5 m": np.concatenate(
        (rectangle(-4, -2.5, 4, 2.5), box(3.5, 2.2, 1, 0.6), box(-1, 0.5, 0.4, 0.4))
    ),
    "office 6 x 5 m": np.concatenate((rectangle(-3, -2.5, 3, 2.5), *DESKS)),
    "corridor 14 x 2 m": np.concatenate((rectangle(-7, -1, 7, 1), *NICHES)),
    "three rooms 12 x 6 m": np.concatenate((rectangle(-4, -3, 8, 3), DOORS, *BENCHES)),
    "lab of the thesis": World.load("lab").segments_m,
}


class Place:
    """Walls as they are now, the map as it was, and a robot somewhere between."""

    def __init__(self, walls: FloatArray, moved: int, rng: np.random.Generator) -> None:
        self.rng, self.known = rng, World(segments_m=walls, circles_m=np.zeros((0, 3))).to_grid()
        ends_m = walls.reshape(-1, 2)
        self.low_m, self.high_m = ends_m.min(axis=0), ends_m.max(axis=0)
        self.true = self.anywhere()
        while not _is_clear(self.known, self.true, 0.25):
            self.true = self.anywhere()
        boxes: list[FloatArray] = []
        while len(boxes) < moved:
            spot = self.anywhere()
            if spot.distance_m(self.true) > 0.7:
                boxes.append(box(spot.x_m, spot.y_m, *rng.uniform(0.2, 0.9, 2)))
        self.walls = np.concatenate((walls, *boxes))
        self.now = World(segments_m=self.walls, circles_m=np.zeros((0, 3))).to_grid() if boxes else self.known

    def anywhere(self) -> Pose2:
        """A pose in the place's bounds."""
        x_m, y_m = self.rng.uniform(self.low_m, self.high_m)
        return Pose2(x_m=x_m, y_m=y_m, theta_rad=self.rng.uniform(-math.pi, math.pi))

    def scan(self) -> Scan:
        """What the lidar measures."""
        angles = -OPENING_RAD / 2 + OPENING_RAD * np.arange(BEAMS) / BEAMS
        beam = np.column_stack((np.cos(self.true.theta_rad + angles), np.sin(self.true.theta_rad + angles)))
        start = self.walls[:, :2] - (self.true.x_m, self.true.y_m)
        edge = self.walls[:, 2:] - self.walls[:, :2]
        cross = np.outer(beam[:, 0], edge[:, 1]) - np.outer(beam[:, 1], edge[:, 0])
        with np.errstate(divide="ignore", invalid="ignore"):
            along = (start[:, 0] * edge[:, 1] - start[:, 1] * edge[:, 0]) / cross
            across = (np.outer(beam[:, 1], start[:, 0]) - np.outer(beam[:, 0], start[:, 1])) / cross
        seen = (cross != 0.0) & (along > 0.0) & (across >= 0.0) & (across <= 1.0)
        ranges_m = np.where(seen, along, np.inf).min(axis=1) + NOISE_M * self.rng.standard_normal(BEAMS)
        return Scan(
            time_s=0.0, ranges_m=np.where(ranges_m > RANGE_M, np.nan, ranges_m), range_max_m=RANGE_M,
            angle_min_rad=-OPENING_RAD / 2, angle_increment_rad=OPENING_RAD / BEAMS,
        )  # fmt: skip

    def drive(self) -> Pose2:
        """A step ahead, or on the spot where something is in the way; returns it as wheels tell it."""
        ahead = Pose2(x_m=0.1, theta_rad=0.12 * self.rng.choice((-1, 1)))
        step = ahead if _is_clear(self.now, self.true @ ahead, 0.2) else Pose2(theta_rad=0.3)
        self.true = self.true @ step
        return Pose2(x_m=1.03 * step.x_m, theta_rad=1.03 * step.theta_rad)

    def off(self, way_m: float, turn_deg: float) -> Pose2:
        """The true pose, wrong by so much."""
        towards = self.rng.uniform(-math.pi, math.pi)
        slip = Pose2(x_m=way_m * math.cos(towards), y_m=way_m * math.sin(towards))
        return self.true @ slip @ Pose2(theta_rad=math.radians(turn_deg) * self.rng.choice((-1, 1)))

    def half_round(self) -> Pose2:
        """Half a turn round the middle."""
        x_m, y_m = self.low_m + self.high_m - (self.true.x_m, self.true.y_m)
        return Pose2(x_m=x_m, y_m=y_m, theta_rad=wrap_angle(self.true.theta_rad + math.pi))


NAMED: dict[str, Callable[[Place], Pose2 | None]] = {
    "0.1 m and 3 degrees off": lambda place: place.off(0.1, 3.0),
    "0.5 m and 20 degrees off": lambda place: place.off(0.5, 20.0),
    "half a turn round the middle": lambda place: place.half_round(),
    "anywhere": lambda place: place.anywhere(),
    "none": lambda _: None,
}


def tried(
    walls: FloatArray, moved: int, named: Callable[[Place], Pose2 | None], seed: int
) -> tuple[str, str]:
    """What is believed after the first scan, and after the drive."""
    place = Place(walls, moved, np.random.default_rng(seed))
    localiser, odometry = Amcl(place.known, map_from_base=named(place), std_m=0.1, std_rad=0.05), Pose2()
    localiser.update(odometry, place.scan(), Twist2())
    first = _judged(localiser, place.true)
    for _ in range(STEPS):
        odometry = odometry @ place.drive()
        localiser.update(odometry, place.scan(), Twist2())
    return first, _judged(localiser, place.true)


def _judged(localiser: Amcl, true: Pose2) -> str:
    if localiser.quality().lost:
        return "doubt"
    found = localiser.map_from_base
    near = found.distance_m(true) < 0.15 and abs(wrap_angle(found.theta_rad - true.theta_rad)) < 0.1
    return "right" if near else "wrong"


def _is_clear(grid: OccupancyGrid, pose: Pose2, margin_m: float) -> bool:
    (row, col), reach = grid.cell_of(pose.x_m, pose.y_m), round(margin_m / grid.resolution_m)
    near = grid.cells[max(0, row - reach) : row + reach + 1, max(0, col - reach) : col + reach + 1]
    return grid.contains(row, col) and bool((near == FREE).all())


def main() -> None:
    """Print how many starts of each kind are right, in doubt and wrong, over all places."""
    parser = argparse.ArgumentParser(description="starts that a person names")
    parser.add_argument("--starts", type=int, default=25, help="in each place, of each kind")
    parser.add_argument("--moved", type=int, default=0, help="boxes that the map does not know")
    arguments = parser.parse_args()
    for kind, named in NAMED.items():
        first, after = Counter[str](), Counter[str]()
        for walls in PLACES.values():
            for seed in range(arguments.starts):
                one, other = tried(walls, arguments.moved, named, seed)
                first[one] += 1
                after[other] += 1
        told = (
            " / ".join(str(count[key]) for key in ("right", "doubt", "wrong")) for count in (first, after)
        )
        what = f"start named: {kind}, {arguments.moved} things moved: right / doubt / wrong"
        figure(what, ", after a drive ".join(told))


if __name__ == "__main__":
    main()
