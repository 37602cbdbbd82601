"""Match a scan in the maps of the particles, in metres: Gauss-Newton, and a window search if that fails."""

import numpy as np

from thumper.common.geometry import FloatArray
from thumper.slam.grid.grid_matcher import SCORE_STD_M, SEARCH_STD_M, SEARCH_STEP_RAD
from thumper.slam.grid.options import GridMapperOptions
from thumper.slam.particle_filter.options import RbpfOptions
from thumper.slam.particle_filter.particle_maps import ParticleMaps
from thumper.slam.particle_filter.particle_match import (
    ParticleMatches,
    ParticleMatchWeights,
    PatchMaps,
    match_all,
)
from thumper.slam.pose_arrays import compose, to_pose
from thumper.slam.scan_matching.correlative import SearchWindow, correlative_search
from thumper.slam.scan_matching.gauss_newton import OUTLIER_M

CLIMB_BELOW = 0.6  # a score below this adds the hill climb
MAX_ITERATIONS = 8  # Gauss-Newton steps per particle


class ParticleMatcher:
    """Scan matching in the maps of the particles."""

    def __init__(self, maps: ParticleMaps, options: GridMapperOptions, filter_options: RbpfOptions) -> None:
        self._maps, self._options, self._filter_options = maps, options, filter_options
        units = np.array([options.resolution_m, options.resolution_m, 1.0])  # a cell, a cell and a radian
        self._square_units: FloatArray = np.outer(units, units)

    def information(self, matches: ParticleMatches, particle: int) -> FloatArray:
        """Return the information of a particle's match in metres and radians, shape (3, 3)."""
        return np.asarray(matches.informations[particle] / self._square_units)

    def match(
        self,
        hits_m: FloatArray,
        predicted: FloatArray,
        information: FloatArray,
        noise: FloatArray,
        which: slice = slice(None),
    ) -> ParticleMatches:
        """Match the particles in `which` from predicted poses, shape (n, 3), in metres and radians.

        `information`, shape (3, 3), is that of odometry. `noise`, shape (n, 3), are standard normal numbers.
        """
        matching, resolution_m = self._options.matching, self._options.resolution_m
        levels_per_m = self._maps.levels_per_cell / resolution_m
        weights = ParticleMatchWeights(
            beam_std=matching.beam_std_m * levels_per_m,
            outlier=OUTLIER_M * levels_per_m,
            score_std=SCORE_STD_M * levels_per_m,
            climb_below=CLIMB_BELOW,
            iterations=MAX_ITERATIONS,
        )
        n, thin = predicted.shape[0], max(1, round(hits_m.shape[0] / self._filter_options.matched_beams))
        matches = ParticleMatches(
            np.empty((n, 3)), noise.copy(), np.empty(n), np.empty(n), np.empty((n, 3, 3))
        )
        match_all(
            hits_m[::thin] / resolution_m,
            self._maps.to_cells(predicted),
            information * self._square_units,
            PatchMaps(self._maps.tables[which], self._maps.pool.distance),
            weights,
            matches,
        )
        return matches._replace(
            poses=self._maps.to_metres(matches.poses), draws=self._maps.to_metres(matches.draws)
        )

    def search_window(self, hits_m: FloatArray, predicted: FloatArray, particle: int) -> FloatArray:
        """Return the predicted poses, moved by what a window search finds for this particle."""
        options, centre = self._options, predicted[particle].copy()
        centre[:2] -= self._maps.corner_m
        thin = max(1, hits_m.shape[0] // self._filter_options.matched_beams)
        window = SearchWindow(
            options.search_window_m, options.search_window_rad, 2.0 * options.resolution_m, SEARCH_STEP_RAD
        )
        field = self._maps.distance_field(particle)
        found = correlative_search(np.ascontiguousarray(hits_m[::thin]), centre, window, field, SEARCH_STD_M)
        found[:2] += self._maps.corner_m
        return compose(predicted, to_pose(predicted[particle]).inverse() @ to_pose(found))
