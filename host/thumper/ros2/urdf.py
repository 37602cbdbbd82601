"""Describe the robot as URDF, and the poses of its links as transforms. Pure."""

from dataclasses import dataclass
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np

from thumper.common.geometry import FloatArray, Pose2
from thumper.config.robot import RobotConfig
from thumper.ros.to_ros import BASE, GPS, LASER

BODY_HEIGHT_M = 0.08
WHEEL_WIDTH_M = 0.06
LIDAR_RADIUS_M, LIDAR_HEIGHT_M = 0.025, 0.04


@dataclass(frozen=True, slots=True, kw_only=True)
class Wheel:
    """One wheel: its link and the position of its axle in base_link."""

    link: str
    x_m: float
    y_m: float


def wheels(config: RobotConfig) -> tuple[Wheel, Wheel]:
    """Return a wheel per side, at the edge of the footprint.

    The configuration has no place of the wheels: its track is the effective one, which a skid-steered base
    has wider than its tyres.
    """
    y_m = float(np.abs(config.footprint.polygon_m()[:, 1]).max()) - 0.5 * WHEEL_WIDTH_M
    return (
        Wheel(link="left_wheel_link", x_m=0.0, y_m=y_m),
        Wheel(link="right_wheel_link", x_m=0.0, y_m=-y_m),
    )


def link_poses(config: RobotConfig) -> dict[str, Pose2]:
    """Return the pose of each link but the sensors' in base_link; all joints are fixed."""
    return {wheel.link: Pose2(x_m=wheel.x_m, y_m=wheel.y_m) for wheel in wheels(config)}


def urdf(config: RobotConfig) -> str:
    """Return the URDF: body of the footprint's box, a wheel per side, the lidar, and the antenna of a GPS.

    base_link lies on the axles' height, as in the configuration. Wheel joints are fixed: their rotation is
    in the topic `wheels`, and viewers then need no joint states.
    """
    robot = Element("robot", name=config.name)
    radius_m = config.drive.wheel_radius_m
    low_m, high_m = _box(config.footprint.polygon_m())
    base = SubElement(robot, "link", name=BASE)
    middle_m = 0.5 * (low_m + high_m)
    place = (float(middle_m[0]), float(middle_m[1]), 0.5 * BODY_HEIGHT_M)
    size_m = " ".join(f"{value:.4g}" for value in (*(high_m - low_m).tolist(), BODY_HEIGHT_M))
    for kind in ("visual", "collision"):
        _shape(base, kind, "box", place, size=size_m)
    for wheel in wheels(config):
        link = SubElement(robot, "link", name=wheel.link)
        disc = {"radius": f"{radius_m:.4g}", "length": f"{WHEEL_WIDTH_M:.4g}"}
        _shape(link, "visual", "cylinder", (0.0, 0.0, 0.0), rpy="1.5708 0 0", **disc)
        _joint(robot, wheel.link, wheel.x_m, wheel.y_m, 0.0)
    lidar = SubElement(robot, "link", name=LASER)
    disc = {"radius": f"{LIDAR_RADIUS_M:.4g}", "length": f"{LIDAR_HEIGHT_M:.4g}"}
    _shape(lidar, "visual", "cylinder", (0.0, 0.0, 0.0), **disc)
    pose = config.lidar.base_from_laser
    _joint(robot, LASER, pose.x_m, pose.y_m, pose.theta_rad)
    if config.gps.enabled:
        SubElement(robot, "link", name=GPS)
        _joint(robot, GPS, config.gps.x_m, config.gps.y_m, 0.0)
    indent(robot)
    return '<?xml version="1.0"?>\n' + tostring(robot, encoding="unicode") + "\n"


def _box(polygon_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    return polygon_m.min(axis=0), polygon_m.max(axis=0)


def _shape(
    link: Element, kind: str, shape: str, xyz_m: tuple[float, float, float], rpy: str = "0 0 0", **size: str
) -> None:
    part = SubElement(link, kind)
    SubElement(part, "origin", xyz=" ".join(f"{value:.4g}" for value in xyz_m), rpy=rpy)
    SubElement(SubElement(part, "geometry"), shape, attrib=dict[str, str](size))


def _joint(robot: Element, child: str, x_m: float, y_m: float, yaw_rad: float) -> None:
    joint = SubElement(robot, "joint", name=child.removesuffix("_link") + "_joint", type="fixed")
    SubElement(joint, "parent", link=BASE)
    SubElement(joint, "child", link=child)
    SubElement(joint, "origin", xyz=f"{x_m:.4g} {y_m:.4g} 0", rpy=f"0 0 {yaw_rad:.6g}")
