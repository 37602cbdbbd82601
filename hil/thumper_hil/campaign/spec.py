"""Read and check a campaign's TOML (missions, seeds, parameter sets) and expand it to jobs."""

import json
import math
import re
from dataclasses import asdict, dataclass, field, replace
from itertools import pairwise, product
from pathlib import Path
from typing import Annotated, Literal

from annotated_types import Ge, Gt, Le, MinLen
from pydantic import AfterValidator, TypeAdapter, with_config

from thumper.common.errors import EXIT_USAGE, ThumperError
from thumper.common.geometry import Pose2
from thumper.common.strict_toml import STRICT, read_checked
from thumper.config.robot import config_to_json, load_config
from thumper.runtime.drive.goal_limits import MAX_GOAL_DISTANCE_M
from thumper_hil.bench.collision import FOOTPRINT_M
from thumper_hil.bench.options import FULL_TURN_DEG
from thumper_hil.campaign.job_digest import HOUSE, content_digest, digest
from thumper_hil.campaign.result_row import MEASURES
from thumper_hil.faults.scenario import load_scenario
from thumper_hil.world.house import house_mission
from thumper_hil.world.scene import Scene
from thumper_hil.world.start_pose import invalid_start_reason
from thumper_hil.world.world import World

HOUSE_HAS_ITS_OWN = "start, goal, via: every house has its own; delete them"


def _plain_name(text: str) -> str:
    """Check a name, which becomes part of keys, addresses and tables."""
    if not re.fullmatch(r"[A-Za-z0-9._-]+", text):
        raise ValueError("a name may contain only letters, digits and . _ -")
    return text


def _known_measure(text: str) -> str:
    if text not in MEASURES:
        raise ValueError(f"choose from {', '.join(MEASURES)}")
    return text


Name = Annotated[str, AfterValidator(_plain_name)]
Measure = Annotated[str, AfterValidator(_known_measure)]


@with_config(STRICT)
@dataclass(frozen=True, slots=True, kw_only=True)
class Seeds:
    """Seeds of the random numbers: `first`, `first + 1`, ..."""

    first: Annotated[int, Ge(0)] = 1
    count: Annotated[int, Gt(0), Le(10_000)] = 10


@with_config(STRICT)
@dataclass(frozen=True, slots=True, kw_only=True)
class MissionSpec:
    """One drive in one world. The start's heading is in degrees, counter-clockwise from x.

    In the world `house` every seed has its own random house, start and goal.
    """

    name: Name
    world: str
    start: tuple[float, float, float] | None = None
    goal: tuple[float, float] | None = None
    via: tuple[tuple[float, float], ...] = ()  # intermediate goals, in order


@with_config(STRICT)
@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterSet:
    """A robot's configuration (default: the Wild Thumper) and its faults."""

    name: Name = "default"
    robot: str = ""  # a robot's TOML, relative to the campaign file's folder
    scenario: str = ""  # a TOML of faults, relative to the same folder
    preset: Literal["nominal", "hard"] = "nominal"  # how hard the simulated robot is


@with_config(STRICT)
@dataclass(frozen=True, slots=True, kw_only=True)
class Campaign:
    """Every mission with every seed and every parameter set; `show` selects the measures of the summary."""

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
    """One drive. World, scenario and masks are paths that must exist on every worker's computer."""

    mission: MissionSpec
    seed: int
    parameters: str
    robot_json: str  # the complete configuration
    scenario: str = ""  # a path
    preset: str = "nominal"
    content: str  # digest of those files, from `content_digest`

    @property
    def key(self) -> str:
        """Key of the job, equal for equal jobs of any run on any computer."""
        return f"{self.mission.name}/{self.parameters}/{self.seed}"


def load_campaign(path: Path) -> Campaign:
    """Read a campaign file.

    Raises
    ------
    ThumperError
        The file cannot be read, or a value is invalid; the message names the key.
    """
    campaign = read_checked(path, TypeAdapter(Campaign), Campaign, "campaign")
    for what, names in (("missions", campaign.missions), ("parameters", campaign.parameters)):
        if len({one.name for one in names}) < len(names):
            raise ThumperError(
                f"{path}: two {what} have the same name; rename one of them", exit_code=EXIT_USAGE
            )
    missions = tuple(replace(one, world=_resolve_world(one.world, path.parent)) for one in campaign.missions)
    for mission in missions:
        if reason := _mission_error(mission):  # reported once here, and not by each job
            raise ThumperError(f"{path}: mission {mission.name}: {reason}", exit_code=EXIT_USAGE)
    sets = tuple(
        replace(one, scenario=str((path.parent / one.scenario).resolve())) if one.scenario else one
        for one in campaign.parameters
    )
    for one in sets:
        if one.scenario:
            load_scenario(Path(one.scenario))
    return replace(campaign, missions=missions, parameters=sets)


def mission_of_seed(mission: MissionSpec, seed: int) -> MissionSpec:
    """Return the mission of this seed: in the world `house` it has its own house, start and goal."""
    if mission.world != HOUSE:
        return mission
    drawn = house_mission(seed)
    start = (drawn.start.x_m, drawn.start.y_m, math.degrees(drawn.start.theta_rad))
    return replace(mission, world=f"{HOUSE}-{seed}", start=start, goal=drawn.goal_m)


def _resolve_world(world: str, folder: Path) -> str:
    """Resolve a world's path relative to the campaign's folder; a built-in world has no suffix."""
    return str((folder / world).resolve()) if Path(world).suffix else world


def _mission_error(mission: MissionSpec) -> str:
    """Return why a mission is certain to fail; empty if it may succeed. Raise ThumperError for its world."""
    if mission.world == HOUSE:
        has_own = mission.start is None and mission.goal is None and not mission.via
        return "" if has_own else HOUSE_HAS_ITS_OWN
    if mission.start is None or mission.goal is None:
        return f"{'goal' if mission.start else 'start'}: missing; add it"
    x_m, y_m, yaw_deg = mission.start
    if abs(yaw_deg) > FULL_TURN_DEG:
        return f"start: the heading {yaw_deg:g} is out of range; give degrees, -360...360"
    pose = Pose2(x_m=x_m, y_m=y_m, theta_rad=math.radians(yaw_deg))
    if reason := invalid_start_reason(Scene(World.load(mission.world)).world, pose, FOOTPRINT_M):
        return f"start: a robot at {x_m:g}, {y_m:g} {reason} of {mission.world}; choose a free start"
    for here, there in pairwise(((x_m, y_m), *mission.via, mission.goal)):
        if math.dist(here, there) > MAX_GOAL_DISTANCE_M:
            return (
                f"{there[0]:g}, {there[1]:g} is more than {MAX_GOAL_DISTANCE_M:g} m from the start or goal "
                "before it; choose closer goals"
            )
    return ""


def expand_jobs(campaign: Campaign, folder: Path) -> list[CampaignJob]:
    """Return all jobs, ordered by seed, so that the first results cover all missions.

    Raises
    ------
    ThumperError
        A robot's TOML or one of its masks is invalid.
    """
    robots = {one.name: load_config(folder / one.robot if one.robot else None) for one in campaign.parameters}
    contents = {
        (mission.name, one.name): content_digest(mission.world, one.scenario, robots[one.name])
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
            preset=one.preset,
            content=contents[mission.name, one.name],
        )
        for seed, mission, one in product(seeds, campaign.missions, campaign.parameters)
    ]


def campaign_digest(jobs: list[CampaignJob]) -> str:
    """Return the digest that identifies a campaign. More seeds do not change it, everything else does.

    Files count by content, not by path.
    """
    return digest(sorted({_without_paths(job) for job in jobs}))


def _without_paths(job: CampaignJob) -> str:
    robot = json.loads(job.robot_json)
    robot["navigation"]["masks"] |= {"keepout": "", "speed": ""}
    content = asdict(job) | {"seed": 0, "scenario": "", "robot_json": robot}
    return json.dumps(content | {"mission": asdict(replace(job.mission, world=""))}, sort_keys=True)
