"""Accuracy of a tag's pose over distance in rendered frames, and tags found in published photographs.

Run: python benchmarks/shared/apriltags.py
     python benchmarks/shared/apriltags.py --photographs FOLDER    # test/data of AprilRobotics/apriltag
"""

import argparse
import math
import re
import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from pyapriltags import Detector

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from thumper.camera.frame import CameraFrame
from thumper.camera.options import CameraOptions
from thumper.camera.tag_tracker import TagTracker
from thumper.camera.tags import find_tags
from thumper.common.geometry import FloatArray, Pose2, wrap_angle
from thumper_hil.sensors.camera import JPEG_QUALITY, NOISE_STD
from thumper_hil.sensors.camera_view import CameraView
from thumper_hil.world.tag_shape import TagShape
from thumper_hil.world.world import World

TAG = TagShape(number=3, x_m=-1.6, y_m=0.1, z_m=0.2, yaw_deg=0.0, size_m=0.1)
DISTANCES_M = (0.45, 0.6, 0.85, 1.15, 1.5, 2.0)
VIEWS, FRAMES = 8, 8
SAME_TAG_PX = 5.0


def accuracy() -> None:
    """Print the errors of the fitted pose."""
    camera = CameraOptions()
    view = CameraView((camera.width_px, camera.height_px), camera.matrix(), camera.base_from_optical())
    world, rng = replace(World.load("lab"), tags=(TAG,)), np.random.default_rng(1)
    for distance_m in DISTANCES_M:
        turns_deg, offsets_mm = [], []
        for _ in range(VIEWS):
            side_rad = float(rng.uniform(-0.2, 0.2))  # of the robot, seen from the tag
            pose = Pose2(
                x_m=TAG.x_m + distance_m * math.cos(side_rad),
                y_m=TAG.y_m + distance_m * math.sin(side_rad),
                theta_rad=math.pi + side_rad + float(rng.uniform(-0.1, 0.1)),
            )
            tracker, clean = TagTracker(TAG.number, TAG.size_m, camera), view.render(world, pose)
            for frame in range(FRAMES):
                noisy = np.clip(clean + rng.normal(0.0, NOISE_STD, clean.shape), 0.0, 255.0).astype(np.uint8)
                jpeg = cv2.imencode(".jpg", noisy, (cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY))[1].tobytes()
                tracker.add(CameraFrame(time_s=0.1 * frame, jpeg=jpeg), pose)
            found = tracker.odom_from_tag
            if found is not None:
                turns_deg.append(math.degrees(wrap_angle(found.theta_rad)))
                offsets_mm.append(1e3 * math.hypot(found.x_m - TAG.x_m, found.y_m - TAG.y_m))
        print(
            f"| {distance_m:.2f} | {distance_m - camera.x_m:.2f} | {_rms(turns_deg):.2f} | "
            f"{_rms(offsets_mm):.1f} | ({len(turns_deg)} of {VIEWS} found)"
        )


def photographs(folder: Path) -> None:
    """Print how many of the listed tags are found, and how far their corners are from the listed ones."""
    own_test = Detector(families="tag36h11", nthreads=1, quad_decimate=1.0, refine_edges=0)
    for settings, detector in (("the robot's", None), ("those of the library's own test", own_test)):
        offsets_px: list[FloatArray] = []
        listed = 0
        for path in sorted(folder.glob("*.jpg")):
            found = find_tags(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE), detector)
            lines = path.with_suffix(".txt").read_text().splitlines()
            expected = [_tag(line) for line in lines if line.strip()]
            offsets_px += [
                offset_px
                for number, corners_px in expected
                for seen in found
                if seen.number == number
                and (offset_px := _corner_offsets(seen.corners_px, corners_px)).max() < SAME_TAG_PX
            ]
            listed += len(expected)
        median_px, most_px = np.percentile(np.concatenate(offsets_px), (50, 95))
        print(
            f"settings: {settings}: {len(offsets_px)} of {listed}; "
            f"corners off by {median_px:.2f} px (median), {most_px:.2f} px (95 %)"
        )


def _tag(line: str) -> tuple[int, FloatArray]:
    number, corners = line.split(",", 1)
    found = re.findall(r"\(([\d.-]+) ([\d.-]+)\)", corners)
    return int(number), np.array(found, dtype=np.float64) - 0.5  # of pixels whose centre is at 0.5


def _corner_offsets(one_px: FloatArray, other_px: FloatArray) -> FloatArray:
    """Return the distances of the corners, whichever corner and direction the list begins with."""
    orders = [np.roll(other_px[::step], shift, axis=0) for step in (1, -1) for shift in range(4)]
    return min((np.hypot(*(one_px - order).T) for order in orders), key=np.sum)


def _rms(values: list[float]) -> float:
    return math.sqrt(float(np.mean(np.square(values)))) if values else math.nan


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--photographs", type=Path)
    arguments = parser.parse_args()
    if arguments.photographs:
        photographs(arguments.photographs)
    else:
        accuracy()
