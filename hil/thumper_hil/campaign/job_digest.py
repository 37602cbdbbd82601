"""What the files say that a drive is made of, as one short text.

It is the same wherever the files lie and on each machine that has the same ones: a campaign that goes on, or
is spread over machines, stays one experiment.
"""

import hashlib
import json
import tomllib
from dataclasses import fields, is_dataclass, replace
from pathlib import Path

import numpy as np

from thumper.config.robot import RobotConfig
from thumper.maps.map_server_io import load_map, read_occupancy
from thumper.navigation.costmap.filters import MODES
from thumper_hil.faults.scenario import load_scenario
from thumper_hil.world.world_file import read_world_file

DIGITS = 16


def content_of(world: str, scenario: str, robot: RobotConfig) -> str:
    """Digest of a world with the map it builds on, of a scenario, and of the masks of a robot.

    Raises
    ------
    ThumperError
        A file is not there, or says something that cannot be: named with the file.
    """
    masks = robot.navigation.masks
    said = [
        _world(world),
        _scenario(Path(scenario)) if scenario else None,
        [_plain(read_occupancy(Path(name), MODES)) for name in (masks.keepout, masks.speed) if name],
    ]
    return digest(said)


def digest(said: object) -> str:
    """A short digest of what JSON can hold."""
    return hashlib.sha256(json.dumps(said, sort_keys=True).encode()).hexdigest()[:DIGITS]


def _world(name_or_path: str) -> object:
    if Path(name_or_path).suffix == ".yaml":
        return _plain(load_map(Path(name_or_path)))
    shapes = read_world_file(name_or_path)
    grid = _plain(load_map(shapes.map_path)) if shapes.map_path else None
    return [_plain(replace(shapes, map_path=None)), grid]


def _scenario(path: Path) -> object:
    load_scenario(path)  # for what it refuses
    return tomllib.loads(path.read_text(encoding="utf-8"))


def _plain(value: object) -> object:
    """Dataclasses, arrays and tuples as JSON can hold them."""
    if is_dataclass(value):
        return {one.name: _plain(getattr(value, one.name)) for one in fields(value)}
    if isinstance(value, np.ndarray):
        return [list(value.shape), hashlib.sha256(np.ascontiguousarray(value).tobytes()).hexdigest()]
    if isinstance(value, tuple):
        return [_plain(one) for one in value]
    return value
