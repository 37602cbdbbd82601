"""Localization from a given initial pose: accurate, rough, rotated by 180 degrees, random, or none.

Run: python benchmarks/localization_starts.py [--starts N] [--moved M]

Simulated rooms and a lidar of 4 m and 240 degrees, with M boxes that are not in the map. The pose is right
within 0.15 m and 0.1 rad, lost if the localizer reports it as lost, and wrong otherwise. It is checked after
the first scan, and after a drive of 14, 60 and 100 steps of 0.1 m, or of 17 degrees where the way is blocked.
Proven wrong counts the starts with a pose more than 0.5 m off that the localizer has ever called proven.
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
from benchmarks.shared.rooms import ROOM, rectangle

from thumper.common.geometry import FloatArray, Pose2, Twist2, wrap_angle
from thumper.lidar.scan import Scan
from thumper.maps.occupancy_grid import FREE, OccupancyGrid
from thumper.slam.localization.amcl import Amcl
from thumper_hil.world.world import World

RANGE_M, OPENING_RAD, BEAMS, NOISE_M = 4.0, math.radians(240), 240, 0.015
CHECKED_AFTER = (0, 14, 60, 100)  # steps
FAR_M = 0.5


def box(x_m: float, y_m: float, width_m: float, height_m: float) -> FloatArray:
    """Return four walls around a centre."""
    return rectangle(x_m - width_m / 2, y_m - height_m / 2, x_m + width_m / 2, y_m + height_m / 2)


DESKS = (box(-1.5, 0, 1.2, 0.6), box(1.5, 0, 1.2, 0.6), box(-2.7, 2.2, 0.6, 0.6), box(2.8, -1.5, 0.4, 1.0))
NICHES = (box(-3, 1, 0.8, 0.3), box(3.3, -1, 0.8, 0.3), box(5, 1, 0.5, 0.4))
DOORS = np.array([[0, -3, 0, -0.5], [0, 0.5, 0, 3], [4, -3, 4, 1], [4, 2, 4, 3.0]])
BENCHES = (box(-2, 2.5, 1, 0.8), box(2, -2.4, 0.6, 0.8), box(6, 0, 0.8, 0.8))
ROOMS = {
    "room 5 x 4 m": ROOM,
    "hall 8 x 5 m": np.concatenate(
        (rectangle(-4, -2.5, 4, 2.5), box(3.5, 2.2, 1, 0.6), box(-1, 0.5, 0.4, 0.4))
    ),
    "office 6 x 5 m": np.concatenate((rectangle(-3, -2.5, 3, 2.5), *DESKS)),
    "corridor 14 x 2 m": np.concatenate((rectangle(-7, -1, 7, 1), *NICHES)),
    "three rooms 12 x 6 m": np.concatenate((rectangle(-4, -3, 8, 3), DOORS, *BENCHES)),
    "lab of the thesis": World.load("lab").segments_m,
}


class Room:
    """The current walls, the map from before, and a robot."""

    def __init__(self, walls: FloatArray, moved: int, rng: np.random.Generator) -> None:
        self.rng, self.map = rng, World(segments_m=walls, circles_m=np.zeros((0, 3))).to_grid()
        ends_m = walls.reshape(-1, 2)
        self.low_m, self.high_m = ends_m.min(axis=0), ends_m.max(axis=0)
        self.true = self.random_pose()
        while not _is_clear(self.map, self.true, 0.25):
            self.true = self.random_pose()
        boxes: list[FloatArray] = []
        while len(boxes) < moved:
            spot = self.random_pose()
            if spot.distance_m(self.true) > 0.7:
                boxes.append(box(spot.x_m, spot.y_m, *rng.uniform(0.2, 0.9, 2)))
        self.walls = np.concatenate((walls, *boxes))
        self.now = World(segments_m=self.walls, circles_m=np.zeros((0, 3))).to_grid() if boxes else self.map

    def random_pose(self) -> Pose2:
        """Return a random pose within the bounds of the room."""
        x_m, y_m = self.rng.uniform(self.low_m, self.high_m)
        return Pose2(x_m=x_m, y_m=y_m, theta_rad=self.rng.uniform(-math.pi, math.pi))

    def scan(self) -> Scan:
        """Return a scan at the true pose."""
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
        """Drive one step ahead, or turn on the spot if the path is blocked; return the odometry step."""
        ahead = Pose2(x_m=0.1, theta_rad=0.12 * self.rng.choice((-1, 1)))
        step = ahead if _is_clear(self.now, self.true @ ahead, 0.2) else Pose2(theta_rad=0.3)
        self.true = self.true @ step
        return Pose2(x_m=1.03 * step.x_m, theta_rad=1.03 * step.theta_rad)

    def with_error(self, error_m: float, error_deg: float) -> Pose2:
        """Return the true pose with an error in a random direction."""
        direction = self.rng.uniform(-math.pi, math.pi)
        shift = Pose2(x_m=error_m * math.cos(direction), y_m=error_m * math.sin(direction))
        return self.true @ shift @ Pose2(theta_rad=math.radians(error_deg) * self.rng.choice((-1, 1)))

    def rotated(self) -> Pose2:
        """Return the true pose, rotated by 180 degrees about the centre of the room."""
        x_m, y_m = self.low_m + self.high_m - (self.true.x_m, self.true.y_m)
        return Pose2(x_m=x_m, y_m=y_m, theta_rad=wrap_angle(self.true.theta_rad + math.pi))


INITIAL_POSES: dict[str, Callable[[Room], Pose2 | None]] = {
    "0.1 m and 3 degrees off": lambda room: room.with_error(0.1, 3.0),
    "0.5 m and 20 degrees off": lambda room: room.with_error(0.5, 20.0),
    "rotated by 180 degrees": lambda room: room.rotated(),
    "random": lambda room: room.random_pose(),
    "none": lambda _: None,
}


def localize(
    walls: FloatArray, moved: int, initial: Callable[[Room], Pose2 | None], seed: int
) -> tuple[list[str], bool]:
    """Return the verdict after each number of steps, and whether a pose far off was ever proven."""
    room = Room(walls, moved, np.random.default_rng(seed))
    localizer, odometry = Amcl(room.map, map_from_base=initial(room), std_m=0.1, std_rad=0.05), Pose2()
    localizer.update(odometry, room.scan(), Twist2())
    verdicts, proven_wrong = [_verdict(localizer, room.true)], False
    for step in range(1, CHECKED_AFTER[-1] + 1):
        odometry = odometry @ room.drive()
        localizer.update(odometry, room.scan(), Twist2())
        if step in CHECKED_AFTER:
            verdicts.append(_verdict(localizer, room.true))
        is_far = localizer.map_from_base.distance_m(room.true) > FAR_M
        proven_wrong |= localizer.proven and is_far and not localizer.quality().lost
    return verdicts, proven_wrong


def _verdict(localizer: Amcl, true: Pose2) -> str:
    if localizer.quality().lost:
        return "lost"
    found = localizer.map_from_base
    near = found.distance_m(true) < 0.15 and abs(wrap_angle(found.theta_rad - true.theta_rad)) < 0.1
    return "right" if near else "wrong"


def _is_clear(grid: OccupancyGrid, pose: Pose2, margin_m: float) -> bool:
    (row, col), reach = grid.cell_of(pose.x_m, pose.y_m), round(margin_m / grid.resolution_m)
    near = grid.cells[max(0, row - reach) : row + reach + 1, max(0, col - reach) : col + reach + 1]
    return grid.contains(row, col) and bool((near == FREE).all())


def main() -> None:
    """Print how many initial poses of each kind end right, lost and wrong, over all rooms."""
    parser = argparse.ArgumentParser(description="localization from a given initial pose")
    parser.add_argument("--starts", type=int, default=25, help="number of starts per room and kind")
    parser.add_argument("--moved", type=int, default=0, help="number of boxes that are not in the map")
    arguments = parser.parse_args()
    for kind, initial in INITIAL_POSES.items():
        counts, proven_wrong = [Counter[str]() for _ in CHECKED_AFTER], 0
        for walls in ROOMS.values():
            for seed in range(arguments.starts):
                verdicts, wrong = localize(walls, arguments.moved, initial, seed)
                proven_wrong += wrong
                for count, verdict in zip(counts, verdicts, strict=True):
                    count[verdict] += 1
        texts = (
            f"{steps}: {' / '.join(str(count[key]) for key in ('right', 'lost', 'wrong'))}"
            for steps, count in zip(CHECKED_AFTER, counts, strict=True)
        )
        what = f"initial pose {kind}, {arguments.moved} unmapped boxes: right / lost / wrong after steps"
        figure(what, f"{', '.join(texts)}; proven wrong {proven_wrong}")


if __name__ == "__main__":
    main()
