"""Mapping with many hypotheses: a Rao-Blackwellized particle filter with scan matching.

Grisetti, Stachniss, Burgard, "Improved techniques for grid mapping with Rao-Blackwellized particle filters",
IEEE T-RO 23(1), 2007.
"""

import math
from dataclasses import replace

import numpy as np

from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.lidar.deskew import ScanPoints, scan_points
from thumper.lidar.scan import Scan
from thumper.maps.hit_counts import HitCounts
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.slam.grid.grid_mapper import is_beyond
from thumper.slam.grid.grid_matcher import SEARCH_BELOW, SEARCH_GAIN, Match
from thumper.slam.grid.options import GridMapperOptions
from thumper.slam.mapper import MapperUpdate, PoseQuality
from thumper.slam.particle_filter.options import RbpfOptions
from thumper.slam.particle_filter.particle_maps import ParticleMaps
from thumper.slam.particle_filter.particle_match import ParticleMatches
from thumper.slam.particle_filter.particle_matcher import ParticleMatcher
from thumper.slam.particle_filter.trajectory_tree import TrajectoryTree
from thumper.slam.pose_arrays import compose, to_pose
from thumper.slam.scan_matching.gauss_newton import MIN_HITS, degenerate_direction, odometry_information
from thumper.slam.scan_matching.pose_covariance import PoseCovariance

WEIGHT_GAIN = 0.05  # share of a beam's evidence that counts: neighbouring beams repeat it
PROPOSAL_STD_SHARE = 0.2  # share of the match's standard deviation by which particles differ


class RbpfMapper:
    """Grisetti's filter behind the `Mapper` protocol.

    A scan after some motion is matched in every particle, weighs them, and is inserted into their maps. Scans
    between are matched in the best particle alone, so that the pose is as recent as the scan.
    """

    def __init__(
        self,
        options: GridMapperOptions | None = None,
        filter_options: RbpfOptions | None = None,
        *,
        base_from_laser: Pose2 | None = None,
        map_from_base: Pose2 | None = None,
    ) -> None:
        """Start with empty maps; `map_from_base` is the pose of the first scan."""
        self._options = options or GridMapperOptions()
        self._filter_options = filter_options or RbpfOptions()
        self._base_from_laser = base_from_laser or Pose2()
        n, resolution_m = self._filter_options.particles, self._options.resolution_m
        start = map_from_base or Pose2()
        self._poses = np.tile(np.array([start.x_m, start.y_m, start.theta_rad]), (n, 1))
        self._log_weights = np.zeros(n)
        self._rng = np.random.default_rng(self._filter_options.seed)
        # At the newest step, that is, at the newest inserted scan; before the first step, at the newest scan.
        self._odom_from_base: Pose2 | None = None
        self._map_from_odom = Pose2()
        self._best = 0
        self._covariance = PoseCovariance(self._options.confidence)
        self._parents = np.arange(n, dtype=np.int32)
        self._trajectories = TrajectoryTree()
        self.maps = ParticleMaps(n, resolution_m, self._options.reach_m, self._options.occupied_fraction)
        self._matcher = ParticleMatcher(self.maps, self._options, self._filter_options)
        self.resamplings = 0

    @property
    def map_from_odom(self) -> Pose2:
        """The correction found by the newest match."""
        return self._map_from_odom

    def quality(self) -> PoseQuality:
        """Return the best particle's covariance plus that of the particles, and whether the pose is lost."""
        quality, weights = self._covariance.quality(), self._weights()
        offsets = self._poses - self._poses[self._best]
        offsets[:, 2] = np.remainder(offsets[:, 2] + math.pi, math.tau) - math.pi
        covariance = quality.covariance + (offsets * weights[:, np.newaxis]).T @ offsets
        return replace(quality, covariance=np.asarray(covariance))

    def resume_at(self, map_from_base: Pose2, map_from_odom: Pose2, covariance: FloatArray) -> None:
        """Continue in the same maps from a pose that another estimator found at a newer scan."""
        step = self._best_pose().inverse() @ map_from_base
        self._poses = compose(self._poses, step)
        self._odom_from_base, self._map_from_odom = map_from_odom.inverse() @ map_from_base, map_from_odom
        self._covariance.reset(covariance)

    @property
    def particle_poses(self) -> FloatArray:
        """x, y, theta of each particle, shape (n, 3)."""
        return self._poses

    @property
    def effective_particles(self) -> float:
        """Effective sample size N_eff, 1 to the number of particles (section III-B)."""
        weights = self._weights()
        return float(1.0 / np.sum(weights * weights))

    def grid(self) -> OccupancyGrid:
        """Return the best particle's map; the same object until a scan is inserted."""
        return self.maps.grid(self._best)

    def counts(self) -> HitCounts:
        """Return a copy of the hits and misses of the best particle's map."""
        return self.maps.counts(self._best)

    def path(self) -> FloatArray:
        """Return x, y, theta at each scan along the best particle's trajectory, shape (scans, 3)."""
        return self._trajectories.path(self._best)

    def warm_up(self) -> None:
        """Compile the kernels, or load them from the cache, on scratch maps."""
        scratch = RbpfMapper(self._options, RbpfOptions(particles=2))
        scan = Scan(
            time_s=0.0,
            ranges_m=np.full(64, min(1.0, 0.5 * self._options.usable_range_m)),
            angle_min_rad=-math.pi,
            angle_increment_rad=math.tau / 64,
        )
        scratch.update(Pose2(), scan, Twist2())
        scratch.update(Pose2(theta_rad=3.0), scan, Twist2())
        hits_m = scan_points(scan, Twist2(), Pose2(), 5.0).hits_m
        scratch._matcher.search_window(hits_m, scratch._poses, 0)
        scratch._resample()
        scratch.grid()

    def update(
        self, odom_from_base: Pose2, scan: Scan, twist: Twist2, *, turn_std_rad: float = math.inf
    ) -> MapperUpdate:
        """Process one scan; see `Mapper.update`.

        A scan with too few usable beams moves the pose by odometry alone and does not change the maps.
        """
        points = scan_points(scan, twist, self._base_from_laser, self._options.usable_range_m)
        hits_m = points.hits_m
        moved = Pose2() if self._odom_from_base is None else self._odom_from_base.inverse() @ odom_from_base
        usable = hits_m.shape[0] >= MIN_HITS
        if not self._trajectories.steps:
            return self._start(odom_from_base, moved, points, usable)
        match, is_step = Match(pose=self._best_pose() @ moved), usable and self._has_moved(moved)
        if usable and not is_step:
            match = self._match_best(hits_m, match.pose, moved)
            # A pushed robot moves without its wheels: the scan alone shows that a step is due.
            is_step = self._is_pushed(match.pose)
            moved = self._best_pose().inverse() @ match.pose if is_step else moved
        if is_step:
            match = self._step(points, hits_m, moved)
            self._odom_from_base = odom_from_base
        self._trajectories.add_scan(self._best_pose().inverse() @ match.pose)
        self._map_from_odom = match.pose @ odom_from_base.inverse()
        inserted = is_step and self._is_explained(match.score)
        return MapperUpdate(map_from_base=match.pose, match_score=match.score, integrated=inserted)

    def _has_moved(self, moved: Pose2) -> bool:
        return (
            math.hypot(moved.x_m, moved.y_m) >= self._options.integrate_distance_m
            or abs(moved.theta_rad) >= self._options.integrate_angle_rad
        )

    def _is_pushed(self, pose: Pose2) -> bool:
        """Return whether the matched pose is further from the last step than odometry's noise explains."""
        distance_m, angle_rad = self._options.integrate_distance_m, self._options.integrate_angle_rad
        return is_beyond(pose, self._best_pose(), 2.0 * distance_m, 2.0 * angle_rad)

    def _start(self, odom_from_base: Pose2, moved: Pose2, points: ScanPoints, usable: bool) -> MapperUpdate:
        """Insert the first usable scan; until there is one, odometry alone moves the particles."""
        self._poses, self._odom_from_base = compose(self._poses, moved), odom_from_base
        pose = to_pose(self._poses[0])
        if usable:
            self.maps.insert(self._poses, points)
            self._trajectories.add_step(self._poses, self._parents)
        self._trajectories.add_scan(Pose2() if usable else pose)
        self._map_from_odom = pose @ odom_from_base.inverse()
        return MapperUpdate(map_from_base=pose, match_score=math.nan, integrated=usable)

    def _step(self, points: ScanPoints, hits_m: FloatArray, moved: Pose2) -> Match:
        """Run one step of the filter; return the best particle's match."""
        if self.effective_particles < self._filter_options.resample_below * self._log_weights.size:
            self._resample()
        matches = self._propose(hits_m, compose(self._poses, moved), moved)
        before = self._best_pose()
        self._weigh(matches)
        score = float(matches.scores[self._best])
        if self._is_explained(score):
            self.maps.insert(self._poses, points)
        self._update_covariance(before, moved, hits_m, matches)
        self._trajectories.add_step(self._poses, self._parents)
        self._parents = np.arange(self._log_weights.size, dtype=np.int32)
        return Match(pose=to_pose(matches.poses[self._best]), score=score)

    def _propose(self, hits_m: FloatArray, predicted: FloatArray, moved: Pose2) -> ParticleMatches:
        """Match all particles and draw from their proposals; search a window if none explains the scan."""
        noise = PROPOSAL_STD_SHARE * self._rng.standard_normal(predicted.shape)
        information = self._odometry_information(hits_m, predicted, moved)
        matches = self._matcher.match(hits_m, predicted, information, noise)
        if matches.scores.max() < SEARCH_BELOW:
            start = self._matcher.search_window(hits_m, predicted, self._best)
            again = self._matcher.match(
                hits_m, start, self._odometry_information(hits_m, start, moved), noise
            )
            if again.scores.max() > matches.scores.max() + SEARCH_GAIN:
                return again
        return matches

    def _weigh(self, matches: ParticleMatches) -> None:
        """Move the particles to their draws and weigh them by the beams."""
        self._log_weights -= WEIGHT_GAIN * matches.costs
        self._log_weights -= self._log_weights.max()
        self._poses = matches.draws
        self._poses[:, 2] = np.remainder(self._poses[:, 2] + math.pi, math.tau) - math.pi
        self._best = int(np.argmax(self._log_weights))

    def _update_covariance(
        self, before: Pose2, moved: Pose2, hits_m: FloatArray, matches: ParticleMatches
    ) -> None:
        self._covariance.predict(before, before @ moved)
        degenerate = degenerate_direction(before.theta_rad + moved.theta_rad, hits_m)
        information = self._matcher.information(matches, self._best)
        self._covariance.update(information, degenerate, float(matches.scores[self._best]))

    def _is_explained(self, score: float) -> bool:
        """Return whether a scan of this score may be inserted: at a wrong pose it would spoil the maps."""
        return score >= self._options.confidence.lost_below

    def _odometry_information(self, hits_m: FloatArray, predicted: FloatArray, moved: Pose2) -> FloatArray:
        """Return the information of the predicted poses, shape (3, 3); the particles differ by little."""
        degenerate = degenerate_direction(float(predicted[0, 2]), hits_m)
        return odometry_information(self._options.matching, moved, degenerate, self._covariance.covariance)

    def _match_best(self, hits_m: FloatArray, predicted: Pose2, moved: Pose2) -> Match:
        """Match the scan in the best particle's map alone."""
        row = np.array([[predicted.x_m, predicted.y_m, predicted.theta_rad]])
        only_best = slice(self._best, self._best + 1)
        information = self._odometry_information(hits_m, row, moved)
        matches = self._matcher.match(hits_m, row, information, np.zeros((1, 3)), only_best)
        return Match(pose=to_pose(matches.poses[0]), score=float(matches.scores[0]))

    def _weights(self) -> FloatArray:
        weights = np.exp(self._log_weights - self._log_weights.max())
        return np.asarray(weights / weights.sum())

    def _resample(self) -> None:
        """Resample with low variance; a surviving particle keeps its index, so few tables are copied."""
        n = self._log_weights.size
        ticks = (self._rng.random() + np.arange(n)) / n
        chosen = np.minimum(np.searchsorted(np.cumsum(self._weights()), ticks), n - 1)
        copies = np.bincount(chosen, minlength=n)
        parents = np.arange(n, dtype=np.int32)
        spare = np.flatnonzero(copies == 0)
        parents[spare] = np.repeat(np.arange(n), np.maximum(copies - 1, 0))
        self.maps.copy_maps(parents)
        self._poses = self._poses[parents]
        self._parents = self._parents[parents]
        self._log_weights = np.zeros(n)
        self.resamplings += 1

    def _best_pose(self) -> Pose2:
        return to_pose(self._poses[self._best])
