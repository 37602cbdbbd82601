"""Adaptive Monte Carlo localization in a known map, with a search of the whole map to recover.

Thrun, Burgard, Fox, "Probabilistic Robotics", 6.4 (likelihood field), 8.3 (Monte Carlo localization) and
table 8.4 (KLD sampling).
"""

import math
from array import array

import numpy as np

from thumper.common.geometry import FloatArray, Pose2, Twist2
from thumper.gps.position_prior import NO_PRIOR, PRIOR_S, PositionPrior
from thumper.lidar.scan import Scan
from thumper.maps.hit_counts import HitCounts
from thumper.maps.occupancy_grid import OccupancyGrid
from thumper.slam.localization.alternative_poses import (
    PRIOR_RATIO,
    SAME_M,
    SAME_RAD,
    AlternativePoses,
    are_close,
)
from thumper.slam.localization.amcl_state import (
    NEAR_GIVEN_M,
    NEAR_GIVEN_RAD,
    RETRY_SCANS,
    GivenPose,
    MapDoubt,
    PoseEstimate,
    Schedule,
)
from thumper.slam.localization.challenge import Challenge
from thumper.slam.localization.likelihood_field import LikelihoodField
from thumper.slam.localization.map_search import MapSearch
from thumper.slam.localization.options import AmclOptions
from thumper.slam.localization.particle_set import ParticleSet, draw_around
from thumper.slam.localization.scan_likelihood import BEAM_GAIN, PoseHypothesis, ScanLikelihood
from thumper.slam.mapper import MapperUpdate, PoseQuality
from thumper.slam.scan_matching.gauss_newton import MIN_HITS
from thumper.slam.scan_matching.pose_trust import PoseTrust

LOST_AFTER = 3  # consecutive weighed scans below `lost_below` before the whole map is searched
SEARCH_GAIN = 0.5  # as `BEAM_GAIN`, for the first scan of a search: nothing was weighed twice yet
LIKELY_LOG_RATIO = 15.0  # prior log odds of the likely pose: people often hide walls, few carry a robot away
OUTSIDE_BELOW = 0.2  # share of beams that contradict the map where the robot has left it, not lost its pose
OUTSIDE_MATCHED = 0.3  # share explained from which the walls still in sight correct the odometry there
PUSHED_GAIN = 0.05  # explained by so much better a pose than by the expected one: the robot was pushed
CARRIED_ABOVE = 0.2  # share of beams through walls at the pose of a robot that was carried away
HIDDEN_SCANS = 30  # unexplained in a row at rest, without beams through walls, from which it was carried, too
MIN_LOG_RATIO, MAX_LOG_RATIO = 1.0, 50.0  # of a pose that contradicts the given one; limit of its odds


class Amcl:
    """Localization behind the `Mapper` protocol; the map stays as it is."""

    def __init__(
        self,
        known_map: OccupancyGrid | LikelihoodField,
        options: AmclOptions | None = None,
        *,
        base_from_laser: Pose2 | None = None,
        map_from_base: Pose2 | None = None,
        std_m: float = 0.3,
        std_rad: float = 0.2,
        odom_from_base: Pose2 | None = None,
        verify: bool = True,
    ) -> None:
        """Start around `map_from_base`, or anywhere in the map (global localization) with None.

        `odom_from_base` is the odometry at that pose, if the robot has already driven. With `verify`, the
        first scan compares the pose with the rest of the map.
        """
        self._options = options or AmclOptions()
        self._base_from_laser = base_from_laser or Pose2()
        self._map = LikelihoodField(known_map) if isinstance(known_map, OccupancyGrid) else known_map
        self._rng = np.random.default_rng(self._options.seed)
        self._estimate = PoseEstimate(pose=Pose2())
        self._schedule = Schedule(search=map_from_base is None)
        self._given = GivenPose()
        self._trust = PoseTrust(trusted=False)
        self._alternatives, self._challenge = AlternativePoses(), Challenge()
        self._map_search = MapSearch()
        self._likely: Pose2 | None = None  # map_from_odom, unless the robot was carried away
        self._prior, self._excluded = NO_PRIOR, ""  # why the newest search found nothing
        self._found: list[PoseHypothesis] = []  # by the newest search of the whole map
        self._beams = MIN_HITS  # of the newest scan, with a return
        self._doubt = MapDoubt()
        self._map_from_odom = Pose2()
        self._path = array("d")  # x, y, theta of each scan in turn, compact: a robot runs for days
        self.relocalizations = 0
        self.refused_pose: Pose2 | None = None  # the newest given pose that the scans contradict
        self._particles = ParticleSet(np.zeros((0, 3)), np.zeros(0))
        if map_from_base is None:
            random_poses = self._map.random_poses(self._options.most_particles, self._rng)
            self._particles = ParticleSet.uniform(random_poses)
        else:
            self.set_pose(map_from_base, std_m, std_rad, odom_from_base)
            if not verify:
                self._given.unverified = None

    @property
    def map_from_odom(self) -> Pose2:
        """The correction at the newest scan."""
        return self._map_from_odom

    @property
    def map_from_base(self) -> Pose2:
        """The robot's pose at the newest scan."""
        if not self._path:
            return self._estimate.pose
        return Pose2(x_m=self._path[-3], y_m=self._path[-2], theta_rad=self._path[-1])

    def set_pose(
        self,
        map_from_base: Pose2,
        std_m: float = 0.3,
        std_rad: float = 0.2,
        odom_from_base: Pose2 | None = None,
    ) -> None:
        """Restart around a pose given by the user; `odom_from_base` is the odometry there.

        If the user gives the same pose again, it is trusted, whatever the rest of the map looks like.
        """
        self._particles = ParticleSet.gaussian(
            map_from_base, std_m, std_rad, self._options.most_particles, self._rng
        )
        self._given.set(map_from_base)
        self._estimate, self._alternatives = PoseEstimate(pose=map_from_base), AlternativePoses()
        self._schedule.search, self._schedule.unexplained = False, 0
        self._map_search.stop()
        self._trust = PoseTrust(trusted=True)
        if odom_from_base is not None:
            self._map_from_odom = map_from_base @ odom_from_base.inverse()

    def set_position_prior(self, prior: PositionPrior) -> None:
        """Expect the robot near this position when the whole map is searched in the next seconds."""
        self._prior = prior

    def set_likely_pose(self, map_from_odom: Pose2) -> None:
        """Compare what each search of the whole map finds with the pose by odometry and this correction.

        A robot that was perhaps carried away is there if it was not: people may only have hidden the map.
        """
        self._likely = map_from_odom

    def relocalize(self) -> None:
        """Discard the pose: the next scan is searched for in the whole map."""
        self._schedule.search, self._schedule.wait_scans = True, 0
        self._map_search.stop()
        self._estimate.odom_from_base, self._given.unverified = None, None

    def quality(self) -> PoseQuality:
        """Return the covariance of the newest pose and whether it is lost."""
        covariance = self._particles.covariance_about(self._estimate.pose)
        return PoseQuality(covariance=covariance, explained=self._estimate.explained, lost=self._lost())

    @property
    def confirmed(self) -> bool:
        """Whether the pose was given, or was confirmed while driving since a search found it."""
        return self._trust.confirmed

    @property
    def proven(self) -> bool:
        """Whether scans over a metre have confirmed the pose, whoever gave it."""
        return self._trust.proven

    @property
    def particles(self) -> int:
        """Current number of particles."""
        return len(self._particles.poses)

    @property
    def particle_poses(self) -> FloatArray:
        """x, y, theta of each particle, shape (n, 3)."""
        return self._particles.poses

    @property
    def map_doubt(self) -> str:
        """Why the map may be the wrong one, or out of date; empty while it fits."""
        return self._doubt.text

    def _lost(self) -> str:
        is_unknown = self._estimate.odom_from_base is None
        if self._schedule.search and self._excluded:
            return self._excluded
        if self._beams < MIN_HITS and (is_unknown or self._schedule.search):
            return (
                f"only {self._beams} beams of the scan return, too few to find the pose in the map: "
                "drive nearer to walls with `thumper teleop`"
            )
        poor = LOST_AFTER if self._trust.proven else 1  # people hide the map from a scan or two
        if not is_unknown and self._schedule.unexplained >= poor:
            return f"the map explains only {100.0 * self._estimate.explained:.0f} % of the scan"
        if self._schedule.search:
            return "the whole map is searched for the pose"
        if is_unknown:
            return "no scan has been matched to the map yet"
        return self._challenge.doubt or self._trust.doubt

    def grid(self) -> OccupancyGrid:
        """Return the map."""
        return self._map.grid

    def counts(self) -> HitCounts:
        """Return hit counts equivalent to the map."""
        return HitCounts.from_grid(self._map.grid)

    def path(self) -> FloatArray:
        """Return x, y, theta at each scan, as estimated at the time, shape (scans, 3)."""
        return np.array(self._path).reshape(-1, 3)

    def warm_up(self) -> None:
        """Compile the kernels, or load them from the cache."""
        scratch = Amcl(self.grid(), self._options)
        scan = Scan(
            time_s=0.0, ranges_m=np.ones(64), angle_min_rad=-math.pi, angle_increment_rad=math.tau / 64
        )
        scratch.update(Pose2(), scan, Twist2())

    def update(
        self, odom_from_base: Pose2, scan: Scan, twist: Twist2, *, turn_std_rad: float = math.inf
    ) -> MapperUpdate:
        """Process one scan; see `Mapper.update`.

        A stationary robot keeps its particles: the same view weighed twice would make it overconfident. A
        robot in doubt weighs it again, because nothing drives it until its pose is known.
        """
        likelihood = ScanLikelihood.of(scan, twist, self._base_from_laser, self._map, self._options)
        self._beams = likelihood.beams
        if scan.time_s > self._prior.time_s + PRIOR_S:
            self._prior, self._excluded = NO_PRIOR, ""
        moved = self._estimate.motion(odom_from_base)
        expected = self._estimate.pose @ moved
        if self._given.unverified is not None and self._map_search.is_running:
            expected = self._given.unverified @ self._map_search.moved(odom_from_base)
        jumped = self._estimate.odom_from_base is None or self._schedule.search
        self._schedule.next_scan(self._trust)
        if self._beams < MIN_HITS:
            return self._record(odom_from_base, expected, math.nan, jumped)
        self._challenge.continue_search(likelihood, odom_from_base, expected, moved)
        is_due = self._is_due(moved)
        was_moved = not is_due and self._was_moved(likelihood, expected)
        was_carried = was_moved and self._schedule.carried_scans > 0
        if not (is_due or was_moved) or not self._search_done(likelihood, odom_from_base):
            return self._record(odom_from_base, expected, math.nan, jumped)
        given = self._given.pop_unverified()
        self._predict(likelihood, odom_from_base, moved, given)
        if given is None and not jumped and (outside := self._outside(likelihood, expected)) is not None:
            self._accept(outside, odom_from_base)
            return self._record(odom_from_base, outside.pose, outside.explained, jumped)
        mean, share = self._weigh(likelihood)
        self._particles.resample(self._options, self._rng)
        hypothesis = likelihood.refine(mean)
        if given is not None and not are_close(hypothesis.pose, given, NEAR_GIVEN_M, NEAR_GIVEN_RAD):
            self._trust = PoseTrust(trusted=False)  # the robot is not where the user put it
            self.refused_pose = given
        if (alternative := self._alternatives.update(likelihood, moved, hypothesis)) is not None:
            self._adopt(alternative, PoseTrust(trusted=False))  # to be confirmed like a searched one
            hypothesis, share, jumped = alternative, 1.0, True
        self._accept(hypothesis, odom_from_base)
        push_m = 0.0 if jumped else hypothesis.pose.distance_m(expected)
        fit = likelihood.fit(hypothesis.pose)
        self._trust.update(fit, share, math.hypot(moved.x_m, moved.y_m), push_m)
        fits_badly = was_carried or self._schedule.unexplained >= LOST_AFTER or self._trust.rejected
        replaced = self._defend(likelihood, odom_from_base, moved, hypothesis, fits_badly=fits_badly)
        if replaced is not None:
            hypothesis, jumped = replaced, True
            self._accept(hypothesis, odom_from_base)
        return self._record(odom_from_base, hypothesis.pose, hypothesis.explained, jumped)

    def _outside(self, likelihood: ScanLikelihood, expected: Pose2) -> PoseHypothesis | None:
        """Return the pose of a robot that has left the map: the scan shows unknown space, and fits otherwise.

        No place of the map is worth a search there, and no particle is better than another.
        """
        matched = likelihood.refine_pose(expected)
        outside = (
            self._trust.confirmed
            and matched.explained < self._options.lost_below
            and likelihood.contradicting_share(matched.pose) < OUTSIDE_BELOW
        )
        if not outside:
            return None
        few = matched.explained < OUTSIDE_MATCHED
        return PoseHypothesis(pose=expected, explained=matched.explained, log=matched.log) if few else matched

    def _defend(
        self,
        likelihood: ScanLikelihood,
        odom_from_base: Pose2,
        moved: Pose2,
        own: PoseHypothesis,
        *,
        fits_badly: bool,
    ) -> PoseHypothesis | None:
        """Search the whole map if the pose fits badly; return the place that replaces a proven one."""
        if not self._trust.proven:
            self._challenge.reset()
            self._schedule.search |= fits_badly
            return None
        found = self._challenge.update(likelihood, odom_from_base, moved, own, fits_badly=fits_badly)
        if found is not None:
            self._adopt(*found)
            self.relocalizations += 1
        return None if found is None else found[0]

    def _is_due(self, moved: Pose2) -> bool:
        """Return whether this scan is weighed."""
        if self._schedule.search:
            return self._schedule.wait_scans == 0
        return (
            self._estimate.odom_from_base is None
            or self._schedule.retry_due(challenged=self._challenge.is_open)
            or math.hypot(moved.x_m, moved.y_m) >= self._options.update_distance_m
            or abs(moved.theta_rad) >= self._options.update_angle_rad
        )

    def _was_moved(self, likelihood: ScanLikelihood, expected: Pose2) -> bool:
        """Return whether somebody has moved the robot: odometry shows nothing, and the scan no longer fits.

        Another pose nearby fits better (a push, or an encoder that misses a turn), or the map explains too
        little for a while: the robot was carried away. Beams through walls show it soon; people who hide the
        walls only make beams shorter.
        """
        carried_scans, self._schedule.carried_scans = self._schedule.carried_scans, 0
        if self._schedule.search or self._estimate.odom_from_base is None:
            return False
        pose = np.array([[expected.x_m, expected.y_m, expected.theta_rad]])
        explained = float(likelihood.likelihoods(pose, 1.0)[1][0])
        if explained > self._estimate.explained - PUSHED_GAIN:
            return False
        if explained < self._options.lost_below:
            self._schedule.carried_scans = carried_scans + 1
            passes = likelihood.through_walls(expected) > CARRIED_ABOVE
            return carried_scans + 1 >= (LOST_AFTER if passes else HIDDEN_SCANS)
        return self._trust.proven and likelihood.refine_pose(expected).explained > explained + PUSHED_GAIN

    def _search_done(self, likelihood: ScanLikelihood, odom_from_base: Pose2) -> bool:
        """Continue the search of the whole map, if one is needed; return False while it goes on.

        Meanwhile the robot is lost, or its given pose is not confirmed yet: nothing drives it.
        """
        if not self._schedule.search and self._given.unverified is None:
            return True
        found = self._map_search.advance(likelihood, odom_from_base)
        self._found = found or []
        if found is not None and self._schedule.search:
            self._found = [hypothesis for hypothesis in found if self._prior.allows(hypothesis.pose)]
            self._excluded = "" if self._found else self._prior.text
            if not self._found:
                self._schedule.wait_scans = RETRY_SCANS
                return False
        if found is not None and self._given.unverified is not None:
            self._follow_given(self._map_search.moved(odom_from_base))
        return found is not None

    def _follow_given(self, moved: Pose2) -> None:
        """Move the given pose and its particles by what the robot moved during the search."""
        assert self._given.unverified is not None
        self._given.unverified = self._given.unverified @ moved
        if moved != Pose2():
            self._particles.move(moved, self._options, self._rng)

    def _predict(
        self, likelihood: ScanLikelihood, odom_from_base: Pose2, moved: Pose2, given: Pose2 | None
    ) -> None:
        """Move the particles, or draw new ones from a global search or around a given pose."""
        if self._schedule.search:
            self._alternatives = AlternativePoses()
            self._draw_from_search(likelihood, odom_from_base)
            self._schedule.wait_scans = RETRY_SCANS
        elif given is not None:
            self._verify(likelihood, given)
        else:
            self._particles.move(moved, self._options, self._rng)

    def _draw_from_search(self, likelihood: ScanLikelihood, odom_from_base: Pose2) -> None:
        """Draw half of the particles around the best poses of the whole map, and half anywhere."""
        n, found = self._options.most_particles, self._found
        likely: PoseHypothesis | None = None
        if self._likely is not None:
            likely = likelihood.refine_pose(self._likely @ odom_from_base)
            found = [each for each in found if not are_close(each.pose, likely.pose, SAME_M, SAME_RAD)]
            found.append(likely)
        logs = SEARCH_GAIN * np.array([hypothesis.log for hypothesis in found])
        logs += [self._prior.log(hypothesis.pose) for hypothesis in found]
        logs += [LIKELY_LOG_RATIO * (hypothesis is likely) for hypothesis in found]
        odds = np.exp(logs - logs.max())
        around, weights = draw_around(found, odds, n // 2, self._rng)
        poses = np.vstack((around, self._map.random_poses(n - n // 2, self._rng)))
        weights = np.concatenate((weights, np.full(n - n // 2, odds.min())))
        self._particles = ParticleSet.weighted(poses, weights)
        self._schedule.search, self._schedule.unexplained = False, 0
        self._trust = PoseTrust(trusted=False)
        self.relocalizations += 1

    def _verify(self, likelihood: ScanLikelihood, given: Pose2) -> None:
        """Draw particles around the given pose, and around poses elsewhere that explain the scan better.

        In a plain room a pose rotated by 180 degrees fits nearly as well. Without this check a wrong given
        pose would be trusted and tracked.
        """
        logs, _ = likelihood.likelihoods(self._particles.poses, 1.0)
        own = likelihood.refine(self._particles.poses[int(np.argmax(logs))])
        found = self._found
        near = [each for each in found if are_close(each.pose, given, NEAR_GIVEN_M, NEAR_GIVEN_RAD)]
        meant = max([own, *near], key=lambda hypothesis: hypothesis.log)
        hypotheses, odds, background = [meant], [PRIOR_RATIO], []
        for other in (each for each in found if each not in near):
            ratio = SEARCH_GAIN * likelihood.log_ratio(other, meant)
            if ratio > MIN_LOG_RATIO:
                hypotheses.append(other)
                odds.append(math.exp(min(ratio, MAX_LOG_RATIO)))
            else:
                background.append((other, ratio))
        self._alternatives = AlternativePoses(background)
        n = self._options.most_particles
        self._particles = ParticleSet.around(hypotheses, np.array(odds), n, self._rng)

    def _weigh(self, likelihood: ScanLikelihood) -> tuple[FloatArray, float]:
        """Weigh the particles; return the best cluster's mean, shape (3,), and share of the weight."""
        logs, _ = likelihood.likelihoods(self._particles.poses, BEAM_GAIN)
        self._particles.weigh(logs)
        return self._particles.best_cluster()

    def _adopt(self, hypothesis: PoseHypothesis, trust: PoseTrust) -> None:
        """Restart around another pose."""
        self._trust, n = trust, self._options.most_particles
        self._particles = ParticleSet.around([hypothesis], np.ones(1), n, self._rng)

    def _accept(self, hypothesis: PoseHypothesis, odom_from_base: Pose2) -> None:
        """Store the estimate, and count whether the map explains the scan there."""
        self._estimate = PoseEstimate(hypothesis.pose, odom_from_base, hypothesis.explained)
        self._doubt.add(hypothesis.explained)
        poor = hypothesis.explained < self._options.lost_below
        self._schedule.unexplained = self._schedule.unexplained + 1 if poor else 0
        self._schedule.skipped, self._schedule.carried_scans = 0, 0

    def _record(self, odom_from_base: Pose2, pose: Pose2, score: float, jumped: bool) -> MapperUpdate:
        self._map_from_odom = pose @ odom_from_base.inverse()
        self._path.extend((pose.x_m, pose.y_m, pose.theta_rad))
        return MapperUpdate(map_from_base=pose, match_score=score, integrated=False, jumped=jumped)
