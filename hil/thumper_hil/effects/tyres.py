"""Tyres under load: the robot moves less per wheel revolution than the unloaded radius says."""

import numpy as np

from thumper_hil.effects.preset import BodyEffects


def rolling_radius_m(radius_m: float, effects: BodyEffects, seed: int) -> float:
    """Return the radius by which the robot of this seed really moves, from sag, wear and slip."""
    spread = effects.distance_spread * float(np.random.default_rng([seed, 0x717E]).standard_normal())
    return radius_m * (1.0 - effects.loaded_radius_loss) * (1.0 + spread)
