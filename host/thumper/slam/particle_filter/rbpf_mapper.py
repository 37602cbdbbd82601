"""Mapping with many hypotheses: a Rao-Blackwellised particle filter, a scan match inside each particle."""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt, Interval

from thumper.common.geometry import FloatArray, Pose2, Twist2, wrap_angle
from thumper.lidar.deskew import ScanPoints, scan_points
from thumper.lidar.scan import Scan
from thumper.maps.hit_counts import HitCounts
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.slam.grid.grid_mapper import MIN_HITS, GridMapperOptions
from thumper.slam.mapper import MapperUpdate, PoseQuality
from thumper.slam.particle_filter.particle_maps import ParticleMaps, pose_row
from thumper.slam.particle_filter.particle_match import match_all
from thumper.slam.particle_filter.trajectory_tree import TrajectoryTree
from thumper.slam.scan_matching.correlative import correlative_search
from thumper.slam.scan_matching.gauss_newton import odometry_information, open_along
from thumper.slam.scan_matching.pose_covariance import PoseCovariance


@dataclass(frozen=True, slots=True, kw_only=True)
class RbpfOptions:
    """Options of the particle filter; those of `GridMapperOptions` hold for it too."""

    particles: Annotated[int, Gt(0)] = 30
    seed: Annotated[int, Ge(0)] = 1  # the same log and seed give the same map
    matched_beams: Annotated[int, Gt(0)] = 180  # hits are thinned to about this many for the match
    cleared_beams: Annotated[int, Gt(0)] = 90  # and as many clear free space, other ones in each scan
    weight_gain: Annotated[float, Gt(0)] = 0.05  # share of a beam's evidence: neighbouring beams repeat it
    spread: Annotated[float, Ge(0)] = 0.2  # share of the match's standard deviation that particles differ by
    resample_below: Annotated[float, Interval(ge=0, le=1)] = 0.5  # resample when N_eff / N falls below
    climb_below: Annotated[float, Interval(ge=0, le=1)] = 0.6  # a score below this adds the hill climb
    iterations: Annotated[int, Gt(0)] = 8  # Gauss-Newton steps a particle, at most


class RbpfMapper:
    """Grisetti's filter behind the `Mapper` protocol.

    A scan after some motion is matched in every particle, weighs them, and is entered into their maps. Scans
    between are matched in the best particle alone, so that the pose given is as fresh as the scan.
    """

    def __init__(
        self,
        options: GridMapperOptions | None = None,
        filtering: RbpfOptions | None = None,
        *,
        base_from_laser: Pose2 | None = None,
        map_from_base: Pose2 | None = None,
    ) -> None:
        """Start with empty maps; `map_from_base` is where the first scan is taken."""
        self._options = options or GridMapperOptions()
        self._filtering = filtering or RbpfOptions()
        self._base_from_laser = base_from_laser or Pose2()
        n, cell_m = self._filtering.particles, self._options.resolution_m
        metres = np.array([cell_m, cell_m, 1.0])  # a cell, a cell and a radian
        self._square_metres: FloatArray = np.outer(metres, metres)
        self._poses = np.tile(pose_row(map_from_base or Pose2()), (n, 1))
        self._log_weights = np.zeros(n)
        self._rng = np.random.default_rng(self._filtering.seed)
        self._odometry: Pose2 | None = None  # at the newest scan entered, before them at the newest
        self._map_from_odom = Pose2()
        self._best = 0
        self._confidence = PoseCovariance(self._options.confidence)
        self._parents = np.arange(n, dtype=np.int32)
        self._lineage = TrajectoryTree()
        self.maps = ParticleMaps(
            n,
            self._options.resolution_m,
            self._options.reach_m,
            self._options.occupied_fraction,
            self._filtering.cleared_beams,
        )
        self.resamplings = 0

    @property
    def map_from_odom(self) -> Pose2:
        """The correction that the last match found."""
        return self._map_from_odom

    def quality(self) -> PoseQuality:
        """How sure the newest pose is: by the best particle's matches, and how far apart the others are."""
        quality, weights = self._confidence.quality(), self._weights()
        apart = self._poses - self._poses[self._best]
        apart[:, 2] = np.remainder(apart[:, 2] + math.pi, math.tau) - math.pi
        covariance = quality.covariance + (apart * weights[:, np.newaxis]).T @ apart
        return PoseQuality(covariance=np.asarray(covariance), explained=quality.explained, lost=quality.lost)

    def resume_at(self, map_from_base: Pose2, map_from_odom: Pose2, covariance: FloatArray) -> None:
        """Go on with the same maps from a pose that somebody else found at a newer scan."""
        step = _pose(self._poses[self._best]).inverse() @ map_from_base
        self._poses = _moved(self._poses, step)
        self._odometry, self._map_from_odom = map_from_odom.inverse() @ map_from_base, map_from_odom
        self._confidence.reset(covariance)

    @property
    def particle_poses(self) -> FloatArray:
        """x, y, theta of each particle, shape (n, 3)."""
        return self._poses

    @property
    def effective_particles(self) -> float:
        """N_eff of the weights, 1 to the number of particles."""
        weights = self._weights()
        return float(1.0 / np.sum(weights * weights))

    def grid(self) -> OccupancyGrid:
        """The best particle's map: free, occupied or unknown; the same object until a scan is entered."""
        return self.maps.grid(self._best)

    def counts(self) -> HitCounts:
        """Hits and misses of the best particle's map (a copy)."""
        return self.maps.counts(self._best)

    def path(self) -> FloatArray:
        """x, y, theta at each scan so far as the best particle sees it now, shape (scans, 3)."""
        return self._lineage.path(self._best)

    def warm_up(self) -> None:
        """Compile the kernels (or load them from the cache) on maps that are thrown away."""
        scratch = RbpfMapper(self._options, RbpfOptions(particles=2))
        scan = Scan(
            time_s=0.0,
            ranges_m=np.full(64, min(1.0, 0.5 * self._options.usable_range_m)),
            angle_min_rad=-math.pi,
            angle_increment_rad=math.tau / 64,
        )
        scratch.update(Pose2(), scan, Twist2())
        scratch.update(Pose2(theta_rad=3.0), scan, Twist2())
        scratch._search(scan_points(scan, Twist2(), Pose2(), 5.0).hits_m(), scratch._poses)
        scratch._resample()
        scratch.grid()

    def update(self, odom_from_base: Pose2, scan: Scan, twist: Twist2) -> MapperUpdate:
        """Take the odometry pose at `scan.time_s` (beam 0) and the speed during the turn, for de-skewing.

        A scan with too few usable beams moves the pose by odometry alone and leaves the maps as they are.
        """
        points = scan_points(scan, twist, self._base_from_laser, self._options.usable_range_m)
        hits_m = points.hits_m()
        moved = Pose2() if self._odometry is None else self._odometry.inverse() @ odom_from_base
        if not self._lineage.steps:
            return self._first(odom_from_base, moved, points, hits_m.shape[0])
        usable = hits_m.shape[0] >= MIN_HITS
        entered = usable and (
            math.hypot(moved.x_m, moved.y_m) >= self._options.integrate_distance_m
            or abs(moved.theta_rad) >= self._options.integrate_angle_rad
        )
        pose, score = _pose(self._poses[self._best]) @ moved, math.nan
        if entered:
            pose, score = self._step(hits_m, points, moved)
            self._odometry = odom_from_base
        elif usable:
            predicted = pose_row(pose)[np.newaxis]
            only = slice(self._best, self._best + 1)
            matched, _, _, scores, _ = self._matched(hits_m, predicted, moved, only, np.zeros((1, 3)))
            pose, score = _pose(matched[0]), float(scores[0])
            # A robot that is pushed moves without its wheels: the scan alone says that it is time to enter.
            entered = self._pushed(pose)
            if entered:
                moved = _pose(self._poses[self._best]).inverse() @ pose
                pose, score = self._step(hits_m, points, moved)
                self._odometry = odom_from_base
        self._lineage.scan(_pose(self._poses[self._best]).inverse() @ pose)
        self._map_from_odom = pose @ odom_from_base.inverse()
        return MapperUpdate(map_from_base=pose, match_score=score, integrated=entered and self._fits(score))

    def _pushed(self, pose: Pose2) -> bool:
        last = _pose(self._poses[self._best])
        return (
            pose.distance_m(last) >= 2.0 * self._options.integrate_distance_m
            or abs(wrap_angle(pose.theta_rad - last.theta_rad)) >= 2.0 * self._options.integrate_angle_rad
        )

    def _first(self, odom_from_base: Pose2, moved: Pose2, points: ScanPoints, hits: int) -> MapperUpdate:
        """Enter the first scan of enough beams; until there is one, odometry alone moves the particles."""
        self._poses, self._odometry = _moved(self._poses, moved), odom_from_base
        pose, entered = _pose(self._poses[0]), hits >= MIN_HITS
        if entered:
            self.maps.integrate(self._poses, points)
            self._lineage.step(self._poses, self._parents)
        self._lineage.scan(Pose2() if entered else pose)
        self._map_from_odom = pose @ odom_from_base.inverse()
        return MapperUpdate(map_from_base=pose, match_score=math.nan, integrated=entered)

    def _step(self, hits_m: FloatArray, points: ScanPoints, moved: Pose2) -> tuple[Pose2, float]:
        """Move, match, weigh, and enter what fits; return the best particle's mode and its score."""
        if self.effective_particles < self._filtering.resample_below * self._log_weights.size:
            self._resample()
        predicted = _moved(self._poses, moved)
        draws = self._filtering.spread * self._rng.standard_normal(predicted.shape)
        found = self._matched(hits_m, predicted, moved, slice(None), draws)
        scores = found[3]
        if scores.max() < self._options.search_below:
            start = self._search(hits_m, predicted)
            again = self._matched(hits_m, start, moved, slice(None), draws)
            if again[3].max() > scores.max() + self._options.search_gain:
                found = again
        matched, drawn, costs, scores, informations = found
        before = _pose(self._poses[self._best])
        self._log_weights -= self._filtering.weight_gain * costs
        self._log_weights -= self._log_weights.max()
        self._poses = drawn
        self._poses[:, 2] = np.remainder(drawn[:, 2] + math.pi, math.tau) - math.pi
        self._best = int(np.argmax(self._log_weights))
        score = float(scores[self._best])
        if self._fits(score):
            self.maps.integrate(self._poses, points)
        self._confidence.moved(before, before @ moved)
        along = open_along(self._options.matching, before.theta_rad + moved.theta_rad, hits_m)
        information = informations[self._best] / self._square_metres
        self._confidence.matched(information, along, score)
        self._lineage.step(self._poses, self._parents)
        self._parents = np.arange(self._log_weights.size, dtype=np.int32)
        return _pose(matched[self._best]), score

    def _fits(self, score: float) -> bool:
        """Whether a scan of this score may be entered: at a pose that is wrong it would spoil the maps."""
        return score >= self._options.confidence.lost_below

    def _matched(
        self, hits_m: FloatArray, predicted: FloatArray, moved: Pose2, which: slice, draws: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
        """Modes and samples, shape (n, 3) [m, m, rad]; costs and scores, (n,); informations, (n, 3, 3).

        The last are in cells and radians.
        """
        options, matching = self._options, self._options.matching
        resolution_m, level = options.resolution_m, self.maps.levels_per_cell / options.resolution_m
        # What is open or unsure for one particle is so for all: they differ by little.
        along = open_along(matching, float(predicted[0, 2]), hits_m)
        trust = odometry_information(matching, moved, along, self._confidence.covariance)
        thin = max(1, round(hits_m.shape[0] / self._filtering.matched_beams))
        n = predicted.shape[0]
        matched, drawn = np.empty((n, 3)), draws.copy()
        costs, scores, informations = np.empty(n), np.empty(n), np.empty((n, 3, 3))
        match_all(
            hits_m[::thin] / resolution_m,
            self.maps.in_cells(predicted),
            trust * self._square_metres,
            self.maps.tables[which],
            self.maps.pool.near,
            matching.beam_std_m * level,
            matching.outlier_m * level,
            options.score_std_m * level,
            self._filtering.climb_below,
            self._filtering.iterations,
            matched,
            drawn,
            costs,
            scores,
            informations,
        )
        return self.maps.in_metres(matched), self.maps.in_metres(drawn), costs, scores, informations

    def _search(self, hits_m: FloatArray, predicted: FloatArray) -> FloatArray:
        """Where a window search round the best particle puts it, and all others moved along with it."""
        options, centre = self._options, predicted[self._best].copy()
        centre[:2] -= self.maps.corner_m
        found = correlative_search(
            np.ascontiguousarray(hits_m[:: max(1, hits_m.shape[0] // self._filtering.matched_beams)]),
            centre,
            options.search_window_m,
            options.search_window_rad,
            2.0 * options.resolution_m,
            0.04,
            self.maps.distance_m(self._best),
            options.resolution_m,
            float(np.float32(self.maps.reach * options.resolution_m)),
            2.0 * options.score_std_m,
        )
        found[:2] += self.maps.corner_m
        return _moved(predicted, _pose(predicted[self._best]).inverse() @ _pose(found))

    def _weights(self) -> FloatArray:
        weights = np.exp(self._log_weights - self._log_weights.max())
        return np.asarray(weights / weights.sum())

    def _resample(self) -> None:
        """Low-variance resampling; a surviving particle keeps its place, so that few tables are copied."""
        n = self._log_weights.size
        ticks = (self._rng.random() + np.arange(n)) / n
        chosen = np.minimum(np.searchsorted(np.cumsum(self._weights()), ticks), n - 1)
        copies = np.bincount(chosen, minlength=n)
        parents = np.arange(n, dtype=np.int32)
        spare = np.flatnonzero(copies == 0)
        parents[spare] = np.repeat(np.arange(n), np.maximum(copies - 1, 0))
        self.maps.inherit(parents)
        self._poses = self._poses[parents]
        self._parents = self._parents[parents]
        self._log_weights = np.zeros(n)
        self.resamplings += 1


def _pose(row: FloatArray) -> Pose2:
    return Pose2(x_m=float(row[0]), y_m=float(row[1]), theta_rad=wrap_angle(float(row[2])))


def _moved(poses: FloatArray, step: Pose2) -> FloatArray:
    """Every pose, shape (n, 3), moved by the same step in its own frame."""
    cos, sin = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    return np.column_stack(
        (
            poses[:, 0] + cos * step.x_m - sin * step.y_m,
            poses[:, 1] + sin * step.x_m + cos * step.y_m,
            poses[:, 2] + step.theta_rad,
        )
    )
