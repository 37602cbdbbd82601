"""Load a world by its name: a file, a map, or a random house."""

from thumper_hil.world.house import house_mission, house_number, with_dark_legs
from thumper_hil.world.world import World


def load_world(name: str, *, dark_legs_share: float = 0.0) -> World:
    """Return `house-17`, `worlds/NAME.toml`, a path that ends in `.toml`, or a map's `.yaml`.

    In a house this share of tables and chairs has dark legs.

    Raises
    ------
    ThumperError
        The world does not exist, or its file is invalid; the message names file and key.
    """
    number = house_number(name)
    if number is None:
        return World.load(name)
    return with_dark_legs(house_mission(number).world, dark_legs_share, number)
