"""Localisation in a known map: an adaptive particle filter, and a search of the whole map to recover.

Thrun, Burgard, Fox, "Probabilistic Robotics", 6.4 (likelihood field) and 8.3 (adaptive Monte-Carlo); number
of particles: Fox, "Adapting the sample size in particle filters through KLD-sampling", IJRR 22(12), 2003.
"""

import math
from array import array
from collections import deque

import numpy as np

from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.lidar.deskew import HIT, scan_points
from thumper.lidar.scan import Scan
from thumper.maps.hit_counts import HitCounts
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.slam.grid.grid_mapper import MIN_HITS
from thumper.slam.localization.alternative_poses import TRUST, AlternativePoses, is_near
from thumper.slam.localization.kld_sampling import resampled
from thumper.slam.localization.likelihood_field import LikelihoodField
from thumper.slam.localization.options import AmclOptions
from thumper.slam.localization.pose_trust import PoseTrust
from thumper.slam.localization.scan_likelihood import PoseHypothesis, ScanLikelihood
from thumper.slam.mapper import MapperUpdate, PoseQuality

RETRY_SCANS = 10  # a lost robot stands: it looks again as often as this
FIRST_GAIN = 0.5  # as `beam_gain`, for the look that a search is made with: nothing was weighed twice yet
NEAR_M, NEAR_RAD = 1.0, 0.5  # a place found so near the one that a person names is meant by it
LOOKS, FITTING = 20, 0.7  # of the right map so many weighed scans explain more; of a wrong one about 0.6
RIVAL, MOST_BETTER = 1.0, 50.0  # of the logarithm of a chance: what makes a rival; what is enough


class Amcl:
    """Localisation behind the `Mapper` protocol: the map stays as it is."""

    def __init__(
        self,
        grid: OccupancyGrid,
        options: AmclOptions | None = None,
        *,
        base_from_laser: Pose2 | None = None,
        map_from_base: Pose2 | None = None,
        std_m: float = 0.3,
        std_rad: float = 0.2,
        odom_from_base: Pose2 | None = None,
        verify: bool = True,
    ) -> None:
        """Start round `map_from_base`, or anywhere in the map (global relocalisation) without it.

        `odom_from_base` is the odometry at that pose, if the robot has driven before. A pose given `verify`
        is compared with the rest of the map at the first scan.
        """
        self._options = options or AmclOptions()
        self._base_from_laser = base_from_laser or Pose2()
        self._field = LikelihoodField(grid, 0.5)
        self._rng = np.random.default_rng(self._options.seed)
        self._odometry: Pose2 | None = None  # at the newest scan that was weighed
        self._map_from_odom = Pose2()
        self._path = array("d")  # x, y, theta in turn: a robot at service is on for days
        self._pose, self._explained, self._doubts, self._share = Pose2(), 0.0, 0, 1.0
        self._searching, self._wait = map_from_base is None, 0
        self._looks: deque[float] = deque(maxlen=LOOKS)  # what the newest weighed scans explained
        self._unweighed = 0  # scans since the newest one that was weighed
        self._evidence = PoseTrust(vouched=False)
        self.relocalizations = 0
        self._poses = np.zeros((0, 3))
        self._told: Pose2 | None = None  # by hand, and not yet compared with the rest of the map
        self._named: Pose2 | None = None  # the last one that was told
        self._rivals = AlternativePoses([], 0.0)
        if map_from_base is None:
            self._poses = self._field.anywhere(self._options.most_particles, self._rng)
        else:
            self.set_pose(map_from_base, std_m, std_rad, odom_from_base)
            self._told = map_from_base if verify else None
        self._weights = np.full(len(self._poses), 1.0 / len(self._poses))

    @property
    def map_from_odom(self) -> Pose2:
        """The correction that the newest scan led to."""
        return self._map_from_odom

    @property
    def map_from_base(self) -> Pose2:
        """Where the robot was at the newest scan."""
        return (
            Pose2(x_m=self._path[-3], y_m=self._path[-2], theta_rad=self._path[-1])
            if (self._path)
            else self._pose
        )

    def set_pose(
        self,
        map_from_base: Pose2,
        std_m: float = 0.3,
        std_rad: float = 0.2,
        odom_from_base: Pose2 | None = None,
    ) -> None:
        """Say by hand where the robot is, and how roughly; `odom_from_base` is the odometry there.

        Who names the same place again is believed, whatever the rest of the map looks like.
        """
        n = self._options.most_particles
        spread = self._rng.standard_normal((n, 3)) * (std_m, std_m, std_rad)
        self._poses = spread + np.array([map_from_base.x_m, map_from_base.y_m, map_from_base.theta_rad])
        self._weights = np.full(n, 1.0 / n)
        insisted = self._named is not None and is_near(map_from_base, self._named, NEAR_M, NEAR_RAD)
        self._told, self._named = None if insisted else map_from_base, map_from_base
        self._pose, self._odometry, self._rivals = map_from_base, None, AlternativePoses([], 0.0)
        self._searching, self._doubts, self._explained, self._share = False, 0, 0.0, 1.0
        self._evidence = PoseTrust(vouched=True)
        if odom_from_base is not None:
            self._map_from_odom = map_from_base @ odom_from_base.inverse()

    def relocalize(self) -> None:
        """Forget the pose: the next scan is looked for in the whole map."""
        self._searching, self._odometry, self._wait, self._told = True, None, 0, None

    def quality(self) -> PoseQuality:
        """How sure the newest pose is."""
        apart = self._poses - np.array([self._pose.x_m, self._pose.y_m, self._pose.theta_rad])
        apart[:, 2] = np.remainder(apart[:, 2] + math.pi, math.tau) - math.pi
        covariance = (apart * self._weights[:, np.newaxis]).T @ apart
        return PoseQuality(covariance=np.asarray(covariance), explained=self._explained, lost=self._lost())

    @property
    def confirmed(self) -> bool:
        """Whether the place is given by hand, or was confirmed on the way since a search found it."""
        return self._evidence.proven

    @property
    def particles(self) -> int:
        """How many are followed just now."""
        return len(self._poses)

    @property
    def particle_poses(self) -> FloatArray:
        """x, y, theta of each, shape (n, 3)."""
        return self._poses

    @property
    def map_doubt(self) -> str:
        """Why this might be the wrong map, or an old one; empty while it fits."""
        share = sum(self._looks) / LOOKS
        if len(self._looks) < LOOKS or share >= FITTING:
            return ""
        return (
            f"the map explains only {100.0 * share:.0f} % of the scans: is it the right one, and up to date?"
        )

    def _lost(self) -> str:
        if self._odometry is None and not self._searching:
            return "no scan has been laid on the map yet"
        if self._searching or self._explained < self._options.lost_below:
            return f"only {100.0 * self._explained:.0f} % of the scan fit the map"
        return self._evidence.doubt

    def grid(self) -> OccupancyGrid:
        """The map as it was given."""
        return self._field.grid

    def counts(self) -> HitCounts:
        """What the map says."""
        return HitCounts.from_grid(self._field.grid)

    def path(self) -> FloatArray:
        """x, y, theta at each scan, as given at the time, shape (scans, 3)."""
        return np.array(self._path).reshape(-1, 3)

    def warm_up(self) -> None:
        """Compile the kernels (or load them from the cache)."""
        scratch = Amcl(self.grid(), self._options)
        scan = Scan(
            time_s=0.0, ranges_m=np.ones(64), angle_min_rad=-math.pi, angle_increment_rad=math.tau / 64
        )
        scratch.update(Pose2(), scan, Twist2())

    def update(self, odom_from_base: Pose2, scan: Scan, twist: Twist2) -> MapperUpdate:
        """Take the odometry pose at `scan.time_s` (beam 0) and the speed during the turn, for de-skewing.

        A robot that stands still keeps its particles: weighing the same view again and again would make it
        sure of whatever it believes. One in doubt looks again: nobody drives it until it knows.
        """
        options = self._options
        points = scan_points(scan, twist, self._base_from_laser, options.usable_range_m)
        hits_m, origins_m = points.hits_m(), points.origins_m[points.kinds == HIT]
        thinned = slice(None, None, max(1, len(hits_m) // options.beams))
        hits_m, origins_m = np.ascontiguousarray(hits_m[thinned]), np.ascontiguousarray(origins_m[thinned])
        laid = ScanLikelihood(origins_m, hits_m, self._field, options)
        moved = Pose2() if self._odometry is None else self._odometry.inverse() @ odom_from_base
        fresh = self._odometry is None
        jumped = fresh or self._searching
        score = math.nan
        pose = expected = self._pose @ moved
        self._wait = max(0, self._wait - 1)
        self._unweighed += 1
        if self._unweighed >= RETRY_SCANS and self._evidence.weak:
            self._searching = True
        in_doubt = self._doubts > 0 and self._unweighed >= RETRY_SCANS
        due = self._wait == 0 if self._searching else fresh or in_doubt or self._has_moved(moved)
        if len(hits_m) >= MIN_HITS and due:
            told, self._told = self._told, None
            if self._searching:
                self._rivals = AlternativePoses([], 0.0)
                self._look_everywhere(laid)
                self._wait = RETRY_SCANS
            elif told is not None:
                self._compare(laid, told)
            else:
                self._diffuse(moved)
            place = self._weigh(laid)
            if told is not None and not is_near(place.pose, told, NEAR_M, NEAR_RAD):
                self._evidence = PoseTrust(vouched=False)  # that is not where the person said it was
            other = self._rivals.look(laid, moved, place)
            if other is not None:
                place, jumped, self._evidence = other, True, PoseTrust(vouched=False)
                self._poses, self._weights = self._around([place], np.ones(1), options.most_particles)
                self._weights /= self._weights.sum()
                self._share = 1.0
            pose, score = place.pose, place.explained
            self._pose, self._odometry, self._explained = pose, odom_from_base, score
            self._unweighed = 0
            self._looks.append(score)
            self._doubts = self._doubts + 1 if score < options.lost_below else 0
            fit = laid.fit(pose)
            off_m = 0.0 if jumped else pose.distance_m(expected)
            self._evidence.add(fit, self._share, math.hypot(moved.x_m, moved.y_m), off_m)
            if self._doubts >= options.lost_after or self._evidence.refuted:
                self._searching = True
        self._map_from_odom = pose @ odom_from_base.inverse()
        self._path.extend((pose.x_m, pose.y_m, pose.theta_rad))
        return MapperUpdate(map_from_base=pose, match_score=score, integrated=False, jumped=jumped)

    def _has_moved(self, moved: Pose2) -> bool:
        return (
            math.hypot(moved.x_m, moved.y_m) >= self._options.update_distance_m
            or abs(moved.theta_rad) >= self._options.update_angle_rad
        )

    def _diffuse(self, moved: Pose2) -> None:
        """Move every particle by odometry and its noise."""
        options, n = self._options, len(self._poses)
        way_m, turn_rad = math.hypot(moved.x_m, moved.y_m), abs(moved.theta_rad)
        noise = self._rng.standard_normal((n, 3)) * (
            options.noise_per_m * way_m + 0.005,
            options.noise_per_m * way_m + 0.005,
            options.noise_per_m * way_m + options.noise_per_rad * turn_rad + 0.002,
        )
        x_m, y_m = moved.x_m + noise[:, 0], moved.y_m + noise[:, 1]
        cos, sin = np.cos(self._poses[:, 2]), np.sin(self._poses[:, 2])
        self._poses[:, 0] += cos * x_m - sin * y_m
        self._poses[:, 1] += sin * x_m + cos * y_m
        self._poses[:, 2] += moved.theta_rad + noise[:, 2]

    def _look_everywhere(self, scan: ScanLikelihood) -> None:
        """Particles round the best places of the whole map, and some anywhere."""
        n, found = self._options.most_particles, scan.everywhere()
        logs = np.array([place.log for place in found])
        chances = np.exp(FIRST_GAIN * (logs - logs.max()))
        around, weights = self._around(found, chances, n // 2)
        self._poses = np.vstack((around, self._field.anywhere(n - n // 2, self._rng)))
        weights = np.concatenate((weights, np.full(n - n // 2, chances.min())))
        self._weights = weights / weights.sum()
        self._searching, self._doubts, self._evidence = False, 0, PoseTrust(vouched=False)
        self.relocalizations += 1

    def _compare(self, scan: ScanLikelihood, told: Pose2) -> None:
        """Particles round the place that a person has named, and round those that explain the scan better.

        Half a turn round in a plain room it fits nearly as well: a wrong name would be believed and followed.
        """
        logs, _ = scan.scored(self._poses, 1.0)
        own, found = scan.refined(self._poses[int(np.argmax(logs))]), scan.everywhere()
        near = [place for place in found if is_near(place.pose, told, NEAR_M, NEAR_RAD)]
        named = max([own, *near], key=lambda place: place.log)
        places, chances, quiet = [named], [TRUST], []
        for rival in found:
            if rival in near:
                continue
            better = FIRST_GAIN * scan.better(rival, named)
            if better > RIVAL:
                places.append(rival)
                chances.append(math.exp(min(better, MOST_BETTER)))
            else:
                quiet.append((rival, better))
        self._rivals = AlternativePoses(quiet, self._options.beam_gain)
        self._poses, weights = self._around(places, np.array(chances), self._options.most_particles)
        self._weights = weights / weights.sum()

    def _around(
        self, places: list[PoseHypothesis], chances: FloatArray, count: int
    ) -> tuple[FloatArray, FloatArray]:
        """As many particles round each place, shape (count, 3), and their weights by its chance."""
        rows = np.array([(place.pose.x_m, place.pose.y_m, place.pose.theta_rad) for place in places])
        which = np.arange(count) % len(places)
        return rows[which] + self._rng.standard_normal((count, 3)) * (0.1, 0.1, 0.05), chances[which]

    def _weigh(self, scan: ScanLikelihood) -> PoseHypothesis:
        """Weigh, resample to the number that KLD asks for; return the refined pose and what it explains."""
        logs, _ = scan.scored(self._poses, self._options.beam_gain)
        weights = self._weights * np.exp(logs - logs.max())
        self._weights = weights / weights.sum()
        best = self._poses[int(np.argmax(self._weights))]
        near = np.hypot(*(self._poses[:, :2] - best[:2]).T) < 0.5
        near &= np.abs(np.remainder(self._poses[:, 2] - best[2] + math.pi, math.tau) - math.pi) < 0.5
        self._share = float(self._weights[near].sum())
        share = self._weights[near] / self._share
        mean = np.append(share @ self._poses[near, :2], best[2])
        turn = np.remainder(self._poses[near, 2] - best[2] + math.pi, math.tau) - math.pi
        mean[2] += float(share @ turn)
        if 1.0 / float(np.sum(self._weights**2)) < 0.5 * len(self._weights):
            self._poses = resampled(self._poses, self._weights, self._options, self._rng)
            self._weights = np.full(len(self._poses), 1.0 / len(self._poses))
        return scan.refined(mean)
