"""Mapping with one hypothesis: match each scan to the map, enter it when the robot has moved."""

import math
from array import array
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt, Interval

from thumper.common.geometry import FloatArray, Pose2, Twist2, wrap_angle
from thumper.lidar.deskew import HIT, ScanPoints, scan_points
from thumper.lidar.scan import Scan
from thumper.maps.hit_counts import HitCounts
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.slam.grid.growing_grid import HitGrid
from thumper.slam.mapper import MapperUpdate, PoseQuality
from thumper.slam.scan_matching.correlative import correlative_search, heading_search
from thumper.slam.scan_matching.gauss_newton import (
    MatchOptions,
    beam_information,
    match,
    odometry_information,
    open_along,
    score,
)
from thumper.slam.scan_matching.map_contradiction import contradicting_share
from thumper.slam.scan_matching.pose_covariance import PoseCovariance, PoseCovarianceOptions

MIN_HITS = 10  # a scan of fewer cannot fix three unknowns against noise
NEW_BELOW = (
    0.2  # share of the hits that contradict the map: fewer, and a scan that it does not explain is new
)
HEADING_GAIN = 0.02  # a pose from another heading must score this much better


@dataclass(frozen=True, slots=True, kw_only=True)
class GridMapperOptions:
    """Options of `GridMapper`."""

    resolution_m: Annotated[float, Interval(ge=0.005, le=1.0)] = 0.05  # side of a cell
    usable_range_m: Annotated[float, Gt(0)] = (
        80.0  # beams count up to here, and never beyond 98 % of the sensor's own limit
    )
    integrate_distance_m: Annotated[float, Ge(0)] = 0.1  # enter a scan after this much way ...
    integrate_angle_rad: Annotated[float, Ge(0)] = 0.1  # ... or this much turn
    occupied_fraction: Annotated[float, Interval(gt=0, lt=1)] = (
        0.25  # share of hits that makes a cell occupied
    )
    reach_m: Annotated[float, Gt(0)] = 0.5  # how far the distance field looks: the basin of the matcher
    score_std_m: Annotated[float, Gt(0)] = 0.1  # width of the beam likelihood that the score is made of
    search_below: Annotated[float, Interval(ge=0, le=1)] = 0.5  # a score below this starts the window search
    search_window_m: Annotated[float, Gt(0)] = 0.5  # half side of the search window
    search_window_rad: Annotated[float, Gt(0)] = 0.4  # and its half angle
    search_gain: Annotated[float, Interval(ge=0, le=1)] = 0.1  # a found pose must score this much better
    matching: MatchOptions = field(default_factory=MatchOptions)
    confidence: PoseCovarianceOptions = field(default_factory=PoseCovarianceOptions)


class GridMapper:
    """Scan-matching SLAM behind the `Mapper` protocol.

    Each scan is matched, so the pose follows even a robot that is pushed; only a scan taken after some motion
    is entered, so standing still neither changes the map nor lets the pose creep along with it.
    """

    def __init__(
        self,
        options: GridMapperOptions | None = None,
        *,
        base_from_laser: Pose2 | None = None,
        map_from_base: Pose2 | None = None,
    ) -> None:
        """Start with an empty map; `map_from_base` is where the first scan is taken."""
        self._options = options or GridMapperOptions()
        self._base_from_laser = base_from_laser or Pose2()
        self._pose = map_from_base or Pose2()
        self._odometry: Pose2 | None = None
        self._integrated_at: Pose2 | None = None
        self._map_from_odom = Pose2()
        self._path = array("d")  # x, y, theta in turn: a robot at service is on for days
        self._confidence = PoseCovariance(self._options.confidence)
        self.cells = HitGrid(
            self._options.resolution_m, self._options.reach_m, self._options.occupied_fraction
        )

    @property
    def map_from_odom(self) -> Pose2:
        """The correction that the last match found."""
        return self._map_from_odom

    @property
    def map_from_base(self) -> Pose2:
        """Where the robot was at the newest scan."""
        return self._pose

    def quality(self) -> PoseQuality:
        """How sure the newest pose is."""
        return self._confidence.quality()

    def resume_at(self, map_from_base: Pose2, map_from_odom: Pose2, covariance: FloatArray) -> None:
        """Go on with the same map from a pose that somebody else found at a newer scan."""
        self._pose, self._map_from_odom = map_from_base, map_from_odom
        self._odometry = map_from_odom.inverse() @ map_from_base
        self._confidence.reset(covariance)

    def replace_map(self, cells: HitGrid, map_from_base: Pose2) -> None:
        """Go on with another map, where the robot now is at `map_from_base`; a scan has just been entered."""
        if self._odometry is not None:
            self._map_from_odom = map_from_base @ self._odometry.inverse()
        self.cells, self._pose, self._integrated_at = cells, map_from_base, map_from_base

    def path(self) -> FloatArray:
        """x, y, theta at each scan so far, shape (scans, 3); one hypothesis never revises them."""
        return np.array(self._path).reshape(-1, 3)

    def grid(self) -> OccupancyGrid:
        """The map so far: free, occupied or unknown; the same object until a scan is entered."""
        return self.cells.grid(percent=False)

    def grid_percent(self) -> OccupancyGrid:
        """The map so far (a copy), each known cell with its share of hits in percent."""
        return self.cells.grid(percent=True)

    def counts(self) -> HitCounts:
        """Hits and misses of the map so far (a copy)."""
        return self.cells.counts()

    def warm_up(self) -> None:
        """Compile the kernels (or load them from the cache) on a map that is thrown away."""
        scratch = GridMapper(self._options)
        scan = Scan(
            time_s=0.0,
            ranges_m=np.full(64, min(1.0, 0.5 * self._options.usable_range_m)),
            angle_min_rad=-math.pi,
            angle_increment_rad=math.tau / 64,
        )
        scratch.update(Pose2(), scan, Twist2())
        scratch.update(Pose2(), scan, Twist2())  # the first one has nothing to match against
        points = scan_points(scan, Twist2(), Pose2(), self._options.usable_range_m)
        scratch._search(points.hits_m(), Pose2())
        scratch._headed(points.hits_m(), Pose2(), 1.0, 1.0)
        scratch._is_new_ground(points, Pose2())
        scratch.grid()

    def update(self, odom_from_base: Pose2, scan: Scan, twist: Twist2) -> MapperUpdate:
        """Take the odometry pose at `scan.time_s` (beam 0) and the speed during the turn, for de-skewing.

        A scan with too few usable beams moves the pose by odometry alone and leaves the map as it is.
        """
        options = self._options
        points = scan_points(scan, twist, self._base_from_laser, options.usable_range_m)
        hits_m = points.hits_m()
        moved = Pose2() if self._odometry is None else self._odometry.inverse() @ odom_from_base
        pose, match_score = self._pose @ moved, math.nan
        self._confidence.moved(self._pose, pose)
        fits = True
        if hits_m.shape[0] >= MIN_HITS and self._integrated_at is not None:
            along = open_along(self._options.matching, pose.theta_rad, hits_m)
            trust = odometry_information(self._options.matching, moved, along)
            pose, match_score = self._matched(hits_m, pose, abs(moved.theta_rad), trust)
            fits = match_score >= options.confidence.lost_below
            new_ground = not fits and self._is_new_ground(points, pose)
            fits = fits or new_ground
            self._confidence.matched(
                self._information(hits_m, pose), along, match_score, new_ground=new_ground
            )
        integrated = hits_m.shape[0] >= MIN_HITS and fits and self._has_moved(pose)
        if integrated:
            self.cells.integrate(pose, points)
            self._integrated_at = pose
        self._pose, self._odometry = pose, odom_from_base
        self._path.extend((pose.x_m, pose.y_m, pose.theta_rad))
        self._map_from_odom = pose @ odom_from_base.inverse()
        return MapperUpdate(map_from_base=pose, match_score=match_score, integrated=integrated)

    def _has_moved(self, pose: Pose2) -> bool:
        last = self._integrated_at
        return last is None or (
            pose.distance_m(last) >= self._options.integrate_distance_m
            or abs(wrap_angle(pose.theta_rad - last.theta_rad)) >= self._options.integrate_angle_rad
        )

    def _is_new_ground(self, points: ScanPoints, pose: Pose2) -> bool:
        hits, cells = points.kinds == HIT, self.cells
        corner, side = np.array(cells.corner_m), cells.resolution_m
        origins, ends = ((pose.apply(at[hits]) - corner) / side for at in (points.origins_m, points.ends_m))
        return contradicting_share(origins, ends, cells.misses, cells.distance_m, side) < NEW_BELOW

    def _matched(
        self, hits_m: FloatArray, predicted: Pose2, turn_rad: float, trust: FloatArray
    ) -> tuple[Pose2, float]:
        """The best pose near the prediction and its score; other starts are tried where one match may err."""
        options = self._options
        outlier_m = options.matching.outlier_m
        pose, match_score = self._match(hits_m, predicted, trust, outlier_m)
        if match_score < options.search_below:
            # Beams that see what the map does not hold yet pull at the pose: let them do so less.
            found, found_score = self._match(hits_m, predicted, trust, 0.5 * outlier_m)
            if found_score > match_score:
                pose, match_score = found, found_score
        # The basin of the heading is the reach over the range: with long beams wheels misread a turn by more.
        window_rad = 2.0 * options.matching.slip_per_rad * turn_rad
        far_m = float(np.percentile(np.hypot(hits_m[:, 0], hits_m[:, 1]), 75.0))
        if window_rad * far_m > options.reach_m:
            start = self._headed(hits_m, predicted, window_rad, 2.0 * options.score_std_m / far_m)
            found, found_score = self._match(hits_m, start, trust, outlier_m)
            if found_score > match_score + HEADING_GAIN:
                pose, match_score = found, found_score
        if match_score < options.search_below:
            found, found_score = self._match(hits_m, self._search(hits_m, predicted), trust, outlier_m)
            if found_score > match_score + options.search_gain:
                pose, match_score = found, found_score
        return pose, match_score

    def _match(
        self, hits_m: FloatArray, start: Pose2, trust: FloatArray, outlier_m: float
    ) -> tuple[Pose2, float]:
        """The pose of least cost near `start`, which `trust` holds it to, and its score."""
        matching, corner = self._options.matching, self._to_corner(start)
        pose = self._from_corner(
            match(
                hits_m,
                corner,
                corner,
                trust,
                self.cells.distance_m,
                self.cells.resolution_m,
                self.cells.reach_m,
                matching.beam_std_m,
                outlier_m,
                matching.iterations,
            )
        )
        return pose, self._score(hits_m, pose)

    def _headed(self, hits_m: FloatArray, predicted: Pose2, window_rad: float, step_rad: float) -> Pose2:
        cells = self.cells
        return self._from_corner(
            heading_search(
                hits_m,
                self._to_corner(predicted),
                window_rad,
                step_rad,
                cells.distance_m,
                cells.resolution_m,
                cells.reach_m,
                2.0 * self._options.score_std_m,
            )
        )

    def _information(self, hits_m: FloatArray, pose: Pose2) -> FloatArray:
        cells, matching = self.cells, self._options.matching
        return beam_information(
            hits_m, self._to_corner(pose), cells.distance_m, cells.resolution_m, cells.reach_m,
            matching.beam_std_m, matching.outlier_m,
        )  # fmt: skip

    def _search(self, hits_m: FloatArray, centre: Pose2) -> Pose2:
        options, cells = self._options, self.cells
        return self._from_corner(
            correlative_search(
                hits_m,
                self._to_corner(centre),
                options.search_window_m,
                options.search_window_rad,
                2.0 * options.resolution_m,
                0.04,
                cells.distance_m,
                cells.resolution_m,
                cells.reach_m,
                2.0 * options.score_std_m,
            )
        )

    def _score(self, hits_m: FloatArray, pose: Pose2) -> float:
        cells = self.cells
        return score(
            hits_m,
            self._to_corner(pose),
            cells.distance_m,
            cells.resolution_m,
            cells.reach_m,
            self._options.score_std_m,
        )

    def _to_corner(self, pose: Pose2) -> FloatArray:
        x_m, y_m = self.cells.corner_m
        return np.array([pose.x_m - x_m, pose.y_m - y_m, pose.theta_rad])

    def _from_corner(self, pose: FloatArray) -> Pose2:
        x_m, y_m = self.cells.corner_m
        return Pose2(x_m=float(pose[0]) + x_m, y_m=float(pose[1]) + y_m, theta_rad=wrap_angle(float(pose[2])))
