"""The page about Nav2: its steps give one parameter file with this robot's frames and footprint."""

import json
import re
import subprocess
import sys
import textwrap
from pathlib import Path
from typing import Any

import pytest
import yaml  # type: ignore[import-untyped]

from thumper.config.robot import RobotConfig
from thumper.ros.to_ros import BASE

PAGE = (Path(__file__).parents[2] / "docs/howto/nav2.md").read_text(encoding="utf-8")
COSTMAP = {"ros__parameters": {"robot_base_frame": "base_link", "robot_radius": 0.22, "use_sim_time": True}}
SHIPPED = {  # the shape of nav2_bringup's file
    "bt_navigator": {"ros__parameters": {"robot_base_frame": "base_footprint", "odom_topic": "/odom"}},
    "collision_monitor": {"ros__parameters": {"base_frame_id": "base_footprint", "use_sim_time": True}},
    "local_costmap": {"local_costmap": COSTMAP},
    "global_costmap": {"global_costmap": COSTMAP},
}


def block(language: str, containing: str) -> str:
    blocks = re.findall(rf"^( *)```{language}\n(.*?)^ *```", PAGE, re.DOTALL | re.MULTILINE)
    (text,) = (textwrap.dedent(body) for _, body in blocks if containing in body)
    return text


@pytest.fixture
def merged(tmp_path: Path) -> dict[str, dict[str, dict[str, object]]]:
    (tmp_path / "nav2_params.yaml").write_text(json.dumps(SHIPPED))
    (tmp_path / "thumper.yaml").write_text(block("yaml", "footprint"))
    script = block("sh", "merge").replace("python3", sys.executable)
    subprocess.run(["bash", "-ec", script], cwd=tmp_path, check=True, timeout=60.0)
    return dict(yaml.safe_load((tmp_path / "nav2.yaml").read_text()))


def test_the_merged_file_has_the_robots_frames_and_footprint(
    merged: dict[str, dict[str, dict[str, object]]],
) -> None:
    bt_navigator = merged["bt_navigator"]["ros__parameters"]
    kept = {"odom_topic": "/odom", "use_sim_time": False}
    assert bt_navigator == {"robot_base_frame": BASE, "transform_tolerance": 0.3, **kept}
    assert merged["collision_monitor"]["ros__parameters"]["base_frame_id"] == BASE
    vertices_m = [list(vertex) for vertex in RobotConfig().footprint.vertices_m]
    for name in ("local_costmap", "global_costmap"):
        costmap = merged[name][name]["ros__parameters"]
        assert isinstance(costmap, dict)
        assert json.loads(costmap["footprint"]) == vertices_m
        assert (costmap["robot_base_frame"], costmap["robot_radius"]) == (BASE, 0.22)


def test_the_controllers_step_is_its_period(merged: dict[str, dict[str, dict[str, Any]]]) -> None:
    """MPPI refuses to start with a step that is shorter than the controller's period."""
    controller = merged["controller_server"]["ros__parameters"]
    assert controller["FollowPath"]["model_dt"] * controller["controller_frequency"] == 1.0
