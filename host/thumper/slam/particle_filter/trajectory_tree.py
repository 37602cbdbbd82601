"""The particles' trajectories as an ancestry tree: the path of the best particle, as it is known now."""

from array import array

import numpy as np

from thumper.common.geometry import FloatArray, Pose2
from thumper.slam.pose_arrays import compose_rows
from thumper.slam.scan_matching.patches import IndexArray

FOLD_EVERY = 64  # steps


class TrajectoryTree:
    """Poses of all particles at each inserted scan, their parents, and the scans between.

    Everything before the particles' last common ancestor is one chain. It is folded into three numbers per
    step, because a robot may map for days.
    """

    def __init__(self) -> None:
        self._folded = array("d")  # x, y, theta of the common ancestor at each step, in turn
        self._poses: list[FloatArray] = []  # of the steps since, shape (particles, 3) each
        self._parents: list[IndexArray] = []  # particle k of this step descends from parents[k] of the last
        self._scans = array("d")  # step, and the scan's x, y, theta seen from the best at that step, in turn

    @property
    def steps(self) -> int:
        """Number of inserted scans."""
        return len(self._folded) // 3 + len(self._poses)

    def add_step(self, poses: FloatArray, parents: IndexArray) -> None:
        """Add the particles' poses at an inserted scan."""
        self._poses.append(poses.copy())
        self._parents.append(parents.astype(np.int16))
        if len(self._poses) % FOLD_EVERY == 0:
            self._fold()

    def add_scan(self, best_from_scan: Pose2) -> None:
        """Add a scan relative to the best particle at the newest step; before the first step, in the map."""
        self._scans.extend((self.steps - 1, best_from_scan.x_m, best_from_scan.y_m, best_from_scan.theta_rad))

    def path(self, best: int) -> FloatArray:
        """Return x, y, theta at each scan, shape (scans, 3), along the ancestors of particle `best`."""
        folded = len(self._folded) // 3
        chain, particle = np.zeros((max(self.steps, 1), 3)), best
        chain[:folded] = np.array(self._folded).reshape(-1, 3)
        for step in range(len(self._poses) - 1, -1, -1):
            chain[folded + step] = self._poses[step][particle]
            particle = int(self._parents[step][particle])
        scans = np.array(self._scans).reshape(-1, 4)
        at, relative = chain[np.maximum(scans[:, 0], 0.0).astype(np.int64)], scans[:, 1:]
        at[scans[:, 0] < 0.0] = 0.0
        return compose_rows(at, relative)

    def _fold(self) -> None:
        """Keep one pose per step, up to the newest step at which all particles have the same ancestor."""
        ancestors, last = np.arange(len(self._poses[-1])), len(self._poses) - 1
        while last >= 0 and (ancestors != ancestors[0]).any():
            ancestors, last = self._parents[last][ancestors].astype(np.int64), last - 1
        if last < 0:
            return
        ancestor, chain = int(ancestors[0]), []
        for step in range(last, -1, -1):
            chain.append(self._poses[step][ancestor])
            ancestor = int(self._parents[step][ancestor])
        self._folded.extend(np.array(chain[::-1]).ravel())
        del self._poses[: last + 1], self._parents[: last + 1]
