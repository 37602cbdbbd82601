"""Clocks of the devices: each runs a little fast or slow against the host's, by seed."""

import numpy as np

from thumper_hil.effects.preset import ClockEffects


def clock_drifts(effects: ClockEffects, seed: int) -> tuple[float, float]:
    """Return the relative errors of the board's and the lidar's clock; positive runs fast."""
    board, lidar = np.random.default_rng([seed, 0xC10C]).uniform(-1.0, 1.0, 2)
    return float(effects.board_drift * board), float(effects.lidar_drift * lidar)
