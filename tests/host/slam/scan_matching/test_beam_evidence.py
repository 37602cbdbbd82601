import math

import numpy as np
from benchmarks.shared.distances import squared_distances_of

from thumper.slam.scan_matching.beam_evidence import WALL_MARGIN_M, KnownCells, beam_evidence
from thumper.slam.scan_matching.distance_field import DistanceField

SIDE, CELL_M, REACH_CELLS = 120, 0.05, 10
STD_M = 0.1


def field_around(walls: np.ndarray) -> DistanceField:
    cut_off_m = REACH_CELLS * CELL_M
    occupied = np.zeros((SIDE, SIDE), bool)
    occupied[tuple(walls.T)] = True
    cells = np.sqrt(squared_distances_of(occupied).astype(float))
    distance_m = np.minimum(CELL_M * cells, cut_off_m).astype(np.float32)
    return DistanceField(distance_m, CELL_M, cut_off_m)


def passes_step_by_step(origin_m: np.ndarray, end_m: np.ndarray, field: DistanceField) -> bool:
    """Look at the map at each cell's length of the beam."""
    length = float(np.hypot(*(end_m - origin_m))) / CELL_M
    for k in range(int(length - WALL_MARGIN_M / CELL_M)):
        col, row = (math.floor(x) for x in (origin_m + (end_m - origin_m) * k / length) / CELL_M)
        if 0 <= row < SIDE and 0 <= col < SIDE and field.distance_m[row, col] == 0.0:
            return True
    return False


def test_evidence_equals_that_of_a_look_at_each_step() -> None:
    """Beams from inside and outside of the map, through few and many walls."""
    rng, n = np.random.default_rng(5), 400
    for count in (0, 3, 30, 300):
        field = field_around(rng.integers(0, SIDE, (count, 2)))
        known = rng.random((SIDE, SIDE)) < 0.5
        origins_m, ends_m = rng.uniform(-1.0, SIDE * CELL_M + 1.0, (2, n, 2))
        found = beam_evidence(origins_m, ends_m, np.zeros(3), field, KnownCells(known), STD_M)

        passes = np.array([passes_step_by_step(*beam, field) for beam in zip(origins_m, ends_m, strict=True)])
        cols, rows = np.floor(ends_m / CELL_M).astype(int).T
        inside = (rows >= 0) & (rows < SIDE) & (cols >= 0) & (cols < SIDE)
        at = rows.clip(0, SIDE - 1), cols.clip(0, SIDE - 1)
        end_m = np.where(inside, field.distance_m[at].astype(np.float64), np.inf)
        likelihoods = np.where(end_m <= WALL_MARGIN_M, np.exp(-0.5 * (end_m / STD_M) ** 2), 0.0)
        was_crossed = inside & known[at]
        unknown = ~passes & (end_m > WALL_MARGIN_M) & ~was_crossed
        counted = max(0.5 * n, n - unknown.sum())

        np.testing.assert_allclose(found.supports, np.where(passes, 0.0, likelihoods), rtol=1e-6)
        assert math.isclose(found.explained, likelihoods.sum() / counted, rel_tol=1e-6)
        assert math.isclose(found.fit, (likelihoods.sum() - passes.sum()) / counted, rel_tol=1e-6)
        assert found.contradicting_share == (passes | ((likelihoods == 0.0) & ~unknown)).sum() / n


def test_no_beam_says_nothing() -> None:
    no_beams = np.zeros((0, 2))
    field, nowhere = field_around(np.zeros((0, 2), np.int64)), KnownCells(np.zeros((SIDE, SIDE), bool))
    found = beam_evidence(no_beams, no_beams, np.zeros(3), field, nowhere, STD_M)
    assert (found.explained, found.fit, found.contradicting_share) == (0.0, 0.0, 0.0)
