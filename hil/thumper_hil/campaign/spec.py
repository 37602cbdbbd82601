"""What a campaign's TOML file says, checked: missions, seeds and parameter sets; and the jobs that follow."""

import hashlib
import json
from dataclasses import asdict, dataclass, field, replace
from itertools import product
from pathlib import Path
from typing import Annotated, Literal

from annotated_types import Ge, Gt, MinLen
from pydantic import ConfigDict, TypeAdapter, with_config

from thumper.config.checked import read_checked
from thumper.config.robot import config_to_json, load_config
from thumper.errors import ThumperError
from thumper_hil.faults.scenario import load_scenario
from thumper_hil.parts.world import World

_STRICT = ConfigDict(extra="forbid")
Measure = Literal[
    "goal_error_m",
    "time_s",
    "path_length_m",
    "pose_rmse_m",
    "pose_max_m",
    "odometry_error_m",
    "odometry_error_rad",
    "speed_error_mean_rad_s",
    "speed_error_std_rad_s",
]
"""The figures of a row (job.Row) that a mean says something of."""


@with_config(_STRICT)
@dataclass(frozen=True, slots=True, kw_only=True)
class Seeds:
    """Seeds of all that is random: `first`, `first + 1`, ..."""

    first: Annotated[int, Ge(0)] = 1
    count: Annotated[int, Gt(0)] = 10


@with_config(_STRICT)
@dataclass(frozen=True, slots=True, kw_only=True)
class MissionSpec:
    """One drive in one world. The start's heading is in degrees, counter-clockwise from x."""

    name: Annotated[str, MinLen(1)]
    world: str
    start: tuple[float, float, float]
    goal: tuple[float, float]
    via: tuple[tuple[float, float], ...] = ()  # goals before it, one after the other: a tour


@with_config(_STRICT)
@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterSet:
    """A robot's configuration, without a file the Wild Thumper's, and what is wrong with it."""

    name: Annotated[str, MinLen(1)] = "default"
    robot: str = ""  # a robot's TOML, from the campaign file's folder
    scenario: str = ""  # a TOML of faults, likewise


@with_config(_STRICT)
@dataclass(frozen=True, slots=True, kw_only=True)
class Campaign:
    """Every mission with every seed and every parameter set; `show` is what the summary tells of them."""

    missions: Annotated[tuple[MissionSpec, ...], MinLen(1)]
    seeds: Seeds = field(default_factory=Seeds)
    parameters: Annotated[tuple[ParameterSet, ...], MinLen(1)] = (ParameterSet(),)
    show: Annotated[tuple[Measure, ...], MinLen(1)] = (
        "goal_error_m",
        "time_s",
        "pose_rmse_m",
        "odometry_error_m",
        "speed_error_std_rad_s",
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """One drive; it holds all that a worker on another machine needs."""

    mission: MissionSpec
    seed: int
    parameters: str
    robot_json: str  # the whole configuration
    scenario: str = ""  # a path

    @property
    def key(self) -> str:
        """The same for the same job, whenever and wherever it is drawn up."""
        return f"{self.mission.name}/{self.parameters}/{self.seed}"


def load_campaign(path: Path) -> Campaign:
    """Read the file.

    Raises
    ------
    ThumperError
        It cannot be read, or says something that cannot be: the key is named.
    """
    campaign = read_checked(path, TypeAdapter(Campaign), Campaign, "campaign")
    for what, names in (("missions", campaign.missions), ("parameters", campaign.parameters)):
        if len({one.name for one in names}) < len(names):
            raise ThumperError(f"{path}: two {what} have the same name", exit_code=2)
    missions = tuple(replace(one, world=_beside(one.world, path.parent)) for one in campaign.missions)
    for mission in missions:
        World.load(mission.world)  # refused here, in one line, and not by each job
    sets = tuple(
        replace(one, scenario=str((path.parent / one.scenario).resolve())) if one.scenario else one
        for one in campaign.parameters
    )
    for one in sets:
        if one.scenario:
            load_scenario(Path(one.scenario))
    return replace(campaign, missions=missions, parameters=sets)


def _beside(world: str, folder: Path) -> str:
    """A world's file is looked for from the campaign's folder; a built-in one has no suffix."""
    return str((folder / world).resolve()) if Path(world).suffix else world


def jobs_of(campaign: Campaign, folder: Path) -> list[Job]:
    """All jobs, a seed after the other, so that what is there early is a cross-section.

    Raises
    ------
    ThumperError
        A robot's TOML is wrong.
    """
    robots = {
        one.name: config_to_json(load_config(folder / one.robot if one.robot else None))
        for one in campaign.parameters
    }
    seeds = range(campaign.seeds.first, campaign.seeds.first + campaign.seeds.count)
    return [
        Job(
            mission=mission,
            seed=seed,
            parameters=one.name,
            robot_json=robots[one.name],
            scenario=one.scenario,
        )
        for seed, mission, one in product(seeds, campaign.missions, campaign.parameters)
    ]


def digest_of(jobs: list[Job]) -> str:
    """What tells a campaign from another: seeds may be added to one, all else makes it a different one."""
    content = sorted({json.dumps(asdict(job) | {"seed": 0}, sort_keys=True) for job in jobs})
    return hashlib.sha256("\n".join(content).encode()).hexdigest()[:16]
