"""Mapping with one hypothesis: match each scan to the map, and insert it once the robot has moved."""

import math
from array import array
from dataclasses import replace

import numpy as np

from thumper.common.geometry import FloatArray, Pose2, Twist2, wrap_angle
from thumper.lidar.deskew import ScanPoints, scan_points
from thumper.lidar.scan import Scan
from thumper.maps.hit_counts import HitCounts
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.slam.grid.grid_matcher import GridMatcher, Match, Prediction
from thumper.slam.grid.growing_grid import HitGrid
from thumper.slam.grid.isolated_hits import without_isolated_hits
from thumper.slam.grid.kidnap_detector import KidnapDetector
from thumper.slam.grid.options import GridMapperOptions
from thumper.slam.grid.slide_detector import SlideDetector
from thumper.slam.mapper import MapperUpdate, PoseQuality
from thumper.slam.scan_matching.gauss_newton import MIN_HITS, degenerate_direction, odometry_information
from thumper.slam.scan_matching.pose_covariance import PoseCovariance

# Least error of a turn that a gyroscope measured: tilt, and scans stamped 10 ms too late or too early.
GYRO_STD_RAD, GYRO_SLIP_PER_RAD = 0.002, 0.03


class GridMapper:
    """Scan-matching SLAM behind the `Mapper` protocol.

    Every scan is matched, so the pose follows even a robot that is pushed. Only a scan taken after some
    motion is inserted, so a stationary robot neither changes the map nor drifts along with it.
    """

    def __init__(
        self,
        options: GridMapperOptions | None = None,
        *,
        base_from_laser: Pose2 | None = None,
        map_from_base: Pose2 | None = None,
    ) -> None:
        """Start with an empty map; `map_from_base` is the pose of the first scan."""
        self._options = options or GridMapperOptions()
        self._base_from_laser = base_from_laser or Pose2()
        self._pose = map_from_base or Pose2()
        self._odom_from_base: Pose2 | None = None  # at the newest scan
        self._map_from_odom = Pose2()
        self._inserted_at: Pose2 | None = None  # pose of the newest inserted scan
        self._all_inserted_at: Pose2 | None = None  # of the newest one inserted with its isolated hits
        self._path = array("d")  # x, y, theta of each scan in turn, compact: a robot runs for days
        self._covariance = PoseCovariance(self._options.confidence)
        self.points: ScanPoints | None = None  # of the newest scan, as inserted
        self._kidnap = KidnapDetector(self._options.integrate_distance_m, self._options.integrate_angle_rad)
        self._slide = SlideDetector(self._options.confidence.lost_beyond_m)
        self.hit_grid = HitGrid(
            self._options.resolution_m, self._options.reach_m, self._options.occupied_fraction
        )

    @property
    def map_from_odom(self) -> Pose2:
        """The correction found by the newest match."""
        return self._map_from_odom

    @property
    def map_from_base(self) -> Pose2:
        """The robot's pose at the newest scan."""
        return self._pose

    def quality(self) -> PoseQuality:
        """Return the covariance of the newest pose and whether it is lost."""
        quality, moved = self._covariance.quality(), self._kidnap.lost or self._slide.lost
        return replace(quality, lost=quality.lost or moved, has_drifted=quality.has_drifted and not moved)

    @property
    def kidnapped(self) -> bool:
        """Whether the robot was carried away, or its pose slid: only a whole-map search can find it."""
        return bool(self._kidnap.lost or self._slide.lost)

    def resume_at(self, map_from_base: Pose2, map_from_odom: Pose2, covariance: FloatArray) -> None:
        """Continue in the same map from a pose that another estimator found at a newer scan."""
        self._pose, self._map_from_odom = map_from_base, map_from_odom
        self._odom_from_base = map_from_odom.inverse() @ map_from_base
        self._covariance.reset(covariance)
        self._kidnap.reset()
        self._slide.reset()

    def replace_map(self, hit_grid: HitGrid, map_from_base: Pose2) -> None:
        """Continue in another map, where the robot is at `map_from_base` and a scan was just inserted."""
        if self._odom_from_base is not None:
            self._map_from_odom = map_from_base @ self._odom_from_base.inverse()
        self.hit_grid, self._pose = hit_grid, map_from_base
        self._inserted_at = self._all_inserted_at = map_from_base

    def trust_pose(self) -> None:
        """Forget that the match slid: a loop closure has found the pose."""
        self._slide.reset()

    def path(self) -> FloatArray:
        """Return x, y, theta at each scan, shape (scans, 3). One hypothesis never revises them."""
        return np.array(self._path).reshape(-1, 3)

    def grid(self) -> OccupancyGrid:
        """Return the map as free, occupied or unknown; the same object until a scan is inserted."""
        return self.hit_grid.grid(percent=False)

    def grid_percent(self) -> OccupancyGrid:
        """Return a copy of the map with the share of hits of each known cell in percent."""
        return self.hit_grid.grid(percent=True)

    def counts(self) -> HitCounts:
        """Return a copy of the map's hits and misses."""
        return self.hit_grid.counts()

    def warm_up(self) -> None:
        """Compile the kernels, or load them from the cache, on a scratch map."""
        scratch = GridMapper(self._options)
        scan = Scan(
            time_s=0.0,
            ranges_m=np.full(64, min(1.0, 0.5 * self._options.usable_range_m)),
            angle_min_rad=-math.pi,
            angle_increment_rad=math.tau / 64,
        )
        scratch.update(Pose2(), scan, Twist2())
        scratch.update(Pose2(), scan, Twist2())  # the first scan has no map to match
        points = scan_points(scan, Twist2(), Pose2(), self._options.usable_range_m)
        matcher = scratch._matcher()
        matcher.search_window(points.hits_m, Pose2())
        matcher.search_headings(points.hits_m, Pose2(), 1.0, 1.0)
        matcher.evidence(points, Pose2())
        without_isolated_hits(points)
        options = self._options
        hit_grid = HitGrid.from_counts(
            scratch.counts(), options.resolution_m, options.reach_m, options.occupied_fraction
        )
        hit_grid.distances_m(1)  # their type follows from the resolution
        scratch.grid()

    def update(
        self, odom_from_base: Pose2, scan: Scan, twist: Twist2, *, turn_std_rad: float = math.inf
    ) -> MapperUpdate:
        """Process one scan; see `Mapper.update`.

        A scan with too few usable beams moves the pose by odometry alone and does not change the map.
        """
        points = scan_points(scan, twist, self._base_from_laser, self._options.usable_range_m)
        self.points, hits_m = points, points.hits_m
        predicted, moved = self._predict(odom_from_base)
        match, consistent, usable = Match(pose=predicted), True, hits_m.shape[0] >= MIN_HITS
        if usable and self._inserted_at is not None:
            degenerate = degenerate_direction(predicted.theta_rad, hits_m)
            match = self._match(points, predicted, moved, degenerate, turn_std_rad)
            evidence = self._matcher().evidence(points, match.pose)
            matched = self._pose.inverse() @ match.pose
            self._kidnap.update(evidence, hits_m, moved, matched)
            if self._kidnap.suspect:
                match, matched = replace(match, pose=predicted), moved
            self._slide.update(hits_m, moved, matched, match.pose.theta_rad)
            new_area = not self._is_explained(match) and evidence.shows_new_area
            consistent = (new_area or self._is_explained(match)) and not self._kidnap.doubtful
            information = self._matcher().information(hits_m, match.pose)
            self._covariance.update(information, degenerate, match.score, new_area=new_area)
        inserted = usable and consistent and self._has_moved(match.pose)
        if inserted:
            self._insert(points, match.pose)
        self._record(odom_from_base, match.pose)
        return MapperUpdate(map_from_base=match.pose, match_score=match.score, integrated=inserted)

    def _predict(self, odom_from_base: Pose2) -> tuple[Pose2, Pose2]:
        """Return the pose predicted by odometry, and the motion since the last scan."""
        moved = Pose2() if self._odom_from_base is None else self._odom_from_base.inverse() @ odom_from_base
        predicted = self._pose @ moved
        self._covariance.predict(self._pose, predicted)
        return predicted, moved

    def _match(
        self, points: ScanPoints, predicted: Pose2, moved: Pose2, degenerate: FloatArray, turn_std_rad: float
    ) -> Match:
        """Return the best match near the predicted pose."""
        matching, turn_rad = self._options.matching, abs(moved.theta_rad)
        most_std_rad = math.hypot(GYRO_STD_RAD, turn_std_rad) + GYRO_SLIP_PER_RAD * turn_rad
        prediction = Prediction(
            pose=predicted,
            turn_rad=turn_rad,
            information=odometry_information(matching, moved, degenerate, turn_std_rad=most_std_rad),
            turn_std_rad=most_std_rad,
        )
        return self._matcher().match(points, prediction)

    def _is_explained(self, match: Match) -> bool:
        """Return whether the map explains the scan at the matched pose."""
        return match.score >= self._options.confidence.lost_below

    def _has_moved(self, pose: Pose2) -> bool:
        """Return whether the robot has moved far enough since the last inserted scan."""
        last, options = self._inserted_at, self._options
        return last is None or is_beyond(
            pose, last, options.integrate_distance_m, options.integrate_angle_rad
        )

    def _insert(self, points: ScanPoints, pose: Pose2) -> None:
        """Insert a scan: isolated hits only where those inserted before are beyond the matcher's reach."""
        last, options = self._all_inserted_at, self._options
        if last is None or is_beyond(pose, last, options.reach_m, options.integrate_angle_rad):
            self._all_inserted_at = pose
        else:
            self.points = points = without_isolated_hits(points)
        self.hit_grid.insert(pose, points)
        self._inserted_at = pose

    def _record(self, odom_from_base: Pose2, pose: Pose2) -> None:
        self._pose, self._odom_from_base = pose, odom_from_base
        self._path.extend((pose.x_m, pose.y_m, pose.theta_rad))
        self._map_from_odom = pose @ odom_from_base.inverse()

    def _matcher(self) -> GridMatcher:
        return GridMatcher(self.hit_grid, self._options)


def is_beyond(pose: Pose2, last: Pose2, distance_m: float, angle_rad: float) -> bool:
    """Return whether two poses differ by at least this distance or angle."""
    turn_rad = abs(wrap_angle(pose.theta_rad - last.theta_rad))
    return pose.distance_m(last) >= distance_m or turn_rad >= angle_rad
