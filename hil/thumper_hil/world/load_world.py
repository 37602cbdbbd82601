"""Load a world by its name: a file, a map, or a random house."""

from thumper_hil.world.house import house_mission, house_number
from thumper_hil.world.world import World


def load_world(name: str) -> World:
    """Return `house-17`, `worlds/NAME.toml`, a path that ends in `.toml`, or a map's `.yaml`.

    Raises
    ------
    ThumperError
        The world does not exist, or its file is invalid; the message names file and key.
    """
    number = house_number(name)
    return World.load(name) if number is None else house_mission(number).world
