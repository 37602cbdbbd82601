"""Digest of the content of the files that define a drive.

It does not depend on where the files are stored. So a campaign that continues later, or on several computers,
stays one experiment.
"""

import hashlib
import json
from dataclasses import fields, is_dataclass, replace
from pathlib import Path

import numpy as np

from thumper.common.toml_file import load_toml
from thumper.config.robot import RobotConfig
from thumper.maps.map_server_io import load_map, read_occupancy
from thumper.navigation.costmap.filters import MODES
from thumper_hil.faults.scenario import load_scenario
from thumper_hil.world.house import house_mission
from thumper_hil.world.world_file import read_world_file

DIGITS = 16
HOUSE = "house"
"""Every seed of a campaign has its own house."""


def content_digest(world: str, scenario: str, robot: RobotConfig) -> str:
    """Return the digest of a world with its base map, of a scenario, and of a robot's masks.

    Raises
    ------
    ThumperError
        A file is missing or invalid; the message names it.
    """
    masks = robot.navigation.masks
    content = [
        _world(world),
        _scenario(Path(scenario)) if scenario else None,
        [_plain(read_occupancy(Path(name), MODES)) for name in (masks.keepout, masks.speed) if name],
    ]
    return digest(content)


def digest(content: object) -> str:
    """Return a short digest of a JSON-serializable object."""
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:DIGITS]


def _world(name_or_path: str) -> object:
    if name_or_path == HOUSE:
        return _plain(house_mission(1))  # all houses come from one generator
    if Path(name_or_path).suffix == ".yaml":
        return _plain(load_map(Path(name_or_path)))
    shapes = read_world_file(name_or_path)
    grid = _plain(load_map(shapes.map_path)) if shapes.map_path else None
    return [_plain(replace(shapes, map_path=None)), grid]


def _scenario(path: Path) -> object:
    load_scenario(path)  # raises if it is invalid
    return load_toml(path)


def _plain(value: object) -> object:
    """Convert dataclasses, arrays and tuples to JSON-serializable objects."""
    if is_dataclass(value):
        compared = (one for one in fields(value) if one.compare)
        return {one.name: _plain(getattr(value, one.name)) for one in compared}
    if isinstance(value, np.ndarray):
        return [list(value.shape), hashlib.sha256(np.ascontiguousarray(value).tobytes()).hexdigest()]
    if isinstance(value, tuple):
        return [_plain(one) for one in value]
    return value
