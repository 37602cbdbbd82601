"""The presets: both load, hard is harder everywhere, and an unknown one is refused."""

from dataclasses import fields
from pathlib import Path

import pytest

import thumper_hil.effects.preset as module
from thumper.common.errors import ThumperError
from thumper_hil.bench.options import BenchOptions
from thumper_hil.effects.friction import floor_friction
from thumper_hil.effects.preset import PRESETS, load_preset


def test_every_value_of_hard_has_a_comment_with_its_source() -> None:
    text = (Path(module.__file__).parent / "hard.toml").read_text(encoding="utf-8")
    values = [line for line in text.splitlines() if "=" in line and not line.startswith("#")]
    assert len(values) >= 20
    assert all("#" in line for line in values)


def test_hard_is_nowhere_easier_than_nominal() -> None:
    nominal, hard = load_preset("nominal"), load_preset("hard")
    for part in fields(nominal):
        easy, difficult = getattr(nominal, part.name), getattr(hard, part.name)
        for one in fields(easy):
            if one.name == "floor":
                assert floor_friction(difficult.floor) > floor_friction(easy.floor)
            elif one.name == "grazing_deg":
                assert difficult.grazing_deg < easy.grazing_deg
            elif one.name != "surfaces":
                assert getattr(difficult, one.name) > getattr(easy, one.name), one.name


@pytest.mark.parametrize("name", PRESETS)
def test_the_port_takes_the_preset(name: str) -> None:
    assert BenchOptions.parse({"preset": name}).preset == name


def test_an_unknown_preset_is_refused() -> None:
    with pytest.raises(ThumperError, match="nominal, hard"):
        load_preset("soft")
    with pytest.raises(ThumperError, match="preset=soft: give nominal or hard"):
        BenchOptions.parse({"preset": "soft"})
