"""What a campaign's TOML file says, checked: missions, seeds and parameter sets; and the jobs that follow."""

import json
import math
import re
from dataclasses import asdict, dataclass, field, replace
from itertools import pairwise, product
from pathlib import Path
from typing import Annotated

from annotated_types import Ge, Gt, Le, MinLen
from pydantic import AfterValidator, ConfigDict, TypeAdapter, with_config

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.geometry import Pose2
from thumper.common.strict_toml import read_checked
from thumper.config.robot import config_to_json, load_config
from thumper.runtime.loop import MAX_GOAL_DISTANCE_M
from thumper_hil.bench.collision import HULL_M
from thumper_hil.bench.options import FULL_TURN_DEG
from thumper_hil.campaign.job_digest import content_of, digest
from thumper_hil.campaign.result_row import MEASURES
from thumper_hil.faults.scenario import load_scenario
from thumper_hil.world.scene import Scene
from thumper_hil.world.start_pose import why_not_here
from thumper_hil.world.world import World

_STRICT = ConfigDict(extra="forbid", allow_inf_nan=False)


def _plain_name(text: str) -> str:
    """A name becomes part of keys, addresses and tables."""
    if not re.fullmatch(r"[A-Za-z0-9._-]+", text):
        raise ValueError("a name is made of letters, digits and . _ - alone")
    return text


def _known_measure(text: str) -> str:
    if text not in MEASURES:
        raise ValueError(f"give some of {', '.join(MEASURES)}")
    return text


Name = Annotated[str, AfterValidator(_plain_name)]
Measure = Annotated[str, AfterValidator(_known_measure)]


@with_config(_STRICT)
@dataclass(frozen=True, slots=True, kw_only=True)
class Seeds:
    """Seeds of all that is random: `first`, `first + 1`, ..."""

    first: Annotated[int, Ge(0)] = 1
    count: Annotated[int, Gt(0), Le(10_000)] = 10


@with_config(_STRICT)
@dataclass(frozen=True, slots=True, kw_only=True)
class MissionSpec:
    """One drive in one world. The start's heading is in degrees, counter-clockwise from x."""

    name: Name
    world: str
    start: tuple[float, float, float]
    goal: tuple[float, float]
    via: tuple[tuple[float, float], ...] = ()  # goals before it, one after the other: a tour


@with_config(_STRICT)
@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterSet:
    """A robot's configuration, without a file the Wild Thumper's, and what is wrong with it."""

    name: Name = "default"
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
class CampaignJob:
    """One drive. World, scenario and masks are paths, which a worker on another machine must have as well."""

    mission: MissionSpec
    seed: int
    parameters: str
    robot_json: str  # the whole configuration
    scenario: str = ""  # a path
    content: str  # of those files: content.content_of

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
            raise ThumperError(f"{path}: two {what} have the same name", exit_code=EXIT_USAGE)
    missions = tuple(replace(one, world=_beside(one.world, path.parent)) for one in campaign.missions)
    for mission in missions:
        if reason := _why_not(mission):  # here, in one line, and not by each job
            raise ThumperError(f"{path}: mission {mission.name}: {reason}", exit_code=EXIT_USAGE)
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


def _why_not(mission: MissionSpec) -> str:
    """Why it cannot be driven, if that is plain from the start; raises ThumperError for its world."""
    x_m, y_m, yaw_deg = mission.start
    if abs(yaw_deg) > FULL_TURN_DEG:
        return f"start: the heading {yaw_deg:g} is none; give degrees, -360...360"
    pose = Pose2(x_m=x_m, y_m=y_m, theta_rad=math.radians(yaw_deg))
    if reason := why_not_here(Scene(World.load(mission.world)).world, pose, HULL_M):
        return f"start: a robot at {x_m:g}, {y_m:g} {reason} of {mission.world}; start it somewhere free"
    for here, there in pairwise(((x_m, y_m), *mission.via, mission.goal)):
        if math.dist(here, there) > MAX_GOAL_DISTANCE_M:
            return (
                f"{there[0]:g}, {there[1]:g} is more than {MAX_GOAL_DISTANCE_M:g} m from where the robot "
                "comes from; choose nearer goals"
            )
    return ""


def jobs_of(campaign: Campaign, folder: Path) -> list[CampaignJob]:
    """All jobs, a seed after the other, so that what is there early is a cross-section.

    Raises
    ------
    ThumperError
        A robot's TOML is wrong, or a mask that it names.
    """
    robots = {one.name: load_config(folder / one.robot if one.robot else None) for one in campaign.parameters}
    contents = {
        (mission.name, one.name): content_of(mission.world, one.scenario, robots[one.name])
        for mission, one in product(campaign.missions, campaign.parameters)
    }
    seeds = range(campaign.seeds.first, campaign.seeds.first + campaign.seeds.count)
    return [
        CampaignJob(
            mission=mission,
            seed=seed,
            parameters=one.name,
            robot_json=config_to_json(robots[one.name]),
            scenario=one.scenario,
            content=contents[mission.name, one.name],
        )
        for seed, mission, one in product(seeds, campaign.missions, campaign.parameters)
    ]


def digest_of(jobs: list[CampaignJob]) -> str:
    """What tells a campaign from another: seeds may be added to one, all else makes it a different one.

    Files count by what they say, not by where they lie.
    """
    return digest(sorted({_without_places(job) for job in jobs}))


def _without_places(job: CampaignJob) -> str:
    robot = json.loads(job.robot_json)
    robot["navigation"]["masks"] |= {"keepout": "", "speed": ""}
    said = asdict(job) | {"seed": 0, "scenario": "", "robot_json": robot}
    return json.dumps(said | {"mission": asdict(replace(job.mission, world=""))}, sort_keys=True)
