"""Who descends from whom: the path of the best particle, told with what was learnt later."""

import math
from array import array

import numpy as np

from thumper.common.geometry import FloatArray, Pose2
from thumper.slam.particle_filter.patches import IndexArray

FOLD_EVERY = 64  # steps


class TrajectoryTree:
    """Poses of all particles at each entered scan, their parents, and the scans between.

    What lies before the particles' last common ancestor is one chain: it is folded into three numbers a step,
    for a robot may map for days.
    """

    def __init__(self) -> None:
        self._folded = array("d")  # x, y, theta of the common ancestor at each step, in turn
        self._poses: list[FloatArray] = []  # of the steps since, shape (particles, 3) each
        self._parents: list[IndexArray] = []  # before the step: particle k of this step came from parents[k]
        self._scans = array("d")  # step, and the scan's x, y, theta seen from the best at that step, in turn

    @property
    def steps(self) -> int:
        """How many scans were entered."""
        return len(self._folded) // 3 + len(self._poses)

    def step(self, poses: FloatArray, parents: IndexArray) -> None:
        """A scan was entered."""
        self._poses.append(poses.copy())
        self._parents.append(parents.astype(np.int16))
        if len(self._poses) % FOLD_EVERY == 0:
            self._fold()

    def scan(self, best_from_scan: Pose2) -> None:
        """A scan was placed relative to the best particle of the newest step; before the first in the map."""
        self._scans.extend((self.steps - 1, best_from_scan.x_m, best_from_scan.y_m, best_from_scan.theta_rad))

    def path(self, best: int) -> FloatArray:
        """x, y, theta at each scan, shape (scans, 3), along the ancestors of particle `best`."""
        folded = len(self._folded) // 3
        chain, who = np.zeros((max(self.steps, 1), 3)), best
        chain[:folded] = np.array(self._folded).reshape(-1, 3)
        for step in range(len(self._poses) - 1, -1, -1):
            chain[folded + step] = self._poses[step][who]
            who = int(self._parents[step][who])
        scans = np.array(self._scans).reshape(-1, 4)
        at, relative = chain[np.maximum(scans[:, 0], 0.0).astype(np.int64)], scans[:, 1:]
        at[scans[:, 0] < 0.0] = 0.0
        cos, sin = np.cos(at[:, 2]), np.sin(at[:, 2])
        theta_rad = at[:, 2] + relative[:, 2]
        return np.column_stack(
            (
                at[:, 0] + cos * relative[:, 0] - sin * relative[:, 1],
                at[:, 1] + sin * relative[:, 0] + cos * relative[:, 1],
                np.remainder(theta_rad + math.pi, math.tau) - math.pi,
            )
        )

    def _fold(self) -> None:
        """Keep one pose a step up to the newest step at which all particles have the same ancestor."""
        who, last = np.arange(len(self._poses[-1])), len(self._poses) - 1
        while last >= 0 and (who != who[0]).any():
            who, last = self._parents[last][who].astype(np.int64), last - 1
        if last < 0:
            return
        ancestor, chain = int(who[0]), []
        for step in range(last, -1, -1):
            chain.append(self._poses[step][ancestor])
            ancestor = int(self._parents[step][ancestor])
        self._folded.extend(np.array(chain[::-1]).ravel())
        del self._poses[: last + 1], self._parents[: last + 1]
