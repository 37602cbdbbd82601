"""Who descends from whom: the path of the best particle, told with what was learnt later."""

import math

import numpy as np

from thumper.geometry import FloatArray, Pose2
from thumper.mapping.patches import IndexArray


class Lineage:
    """Poses of all particles at each entered scan, their parents, and the scans between."""

    def __init__(self) -> None:
        self._poses: list[FloatArray] = []  # shape (particles, 3) each, float32 is enough for a record
        self._parents: list[IndexArray] = []  # before the step: particle k of this step came from parents[k]
        self._scans: list[tuple[int, Pose2]] = []  # step, and the scan's pose seen from the best at that step

    def step(self, poses: FloatArray, parents: IndexArray) -> None:
        """A scan was entered."""
        self._poses.append(poses.copy())
        self._parents.append(parents.astype(np.int16))

    def scan(self, best_from_scan: Pose2) -> None:
        """A scan was placed relative to the best particle of the newest step."""
        self._scans.append((len(self._poses) - 1, best_from_scan))

    def path(self, best: int) -> FloatArray:
        """x, y, theta at each scan, shape (scans, 3), along the ancestors of particle `best`."""
        steps = len(self._poses)
        chain, who = np.zeros((max(steps, 1), 3)), best
        for step in range(steps - 1, -1, -1):
            chain[step] = self._poses[step][who]
            who = int(self._parents[step][who])
        out = np.zeros((len(self._scans), 3))
        for i, (step, relative) in enumerate(self._scans):
            x_m, y_m, theta_rad = chain[max(step, 0)]
            cos, sin = math.cos(theta_rad), math.sin(theta_rad)
            out[i, 0] = x_m + cos * relative.x_m - sin * relative.y_m
            out[i, 1] = y_m + sin * relative.x_m + cos * relative.y_m
            out[i, 2] = math.remainder(theta_rad + relative.theta_rad, math.tau)
        return out
