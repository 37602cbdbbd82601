"""A small campaign file and a result row for the tests."""

from pathlib import Path

from thumper_hil.campaign.result_row import MEASURES, CampaignRow

FILE = """
seeds = { first = 3, count = 2 }
parameters = [{ name = "default" }, { name = "gentle", robot = "gentle.toml" }]

[[missions]]
name = "step"
world = "lab"
start = [1.0, 0.0, 180.0]
via = [[0.8, 0.0]]
goal = [0.6, 0.0]
"""


def written(folder: Path, text: str = FILE) -> Path:
    (folder / "gentle.toml").write_text("[navigation.limits]\nv_max_m_s = 0.3\n")
    path = folder / "campaign.toml"
    path.write_text(text)
    return path


def row(key: str, **changed: object) -> CampaignRow:
    numbers = dict.fromkeys(MEASURES, 0.25)
    fixed = {"key": key, "mission": "m", "parameters": "p", "seed": 1, "reached": True, "contacts": 0}
    return CampaignRow(**(numbers | fixed | {"reason": 'said "so", and more'} | changed))  # type: ignore[arg-type]
