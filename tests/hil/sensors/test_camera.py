"""The camera's driver on the simulated camera: frames, tags, recording, doctor, refusal."""

import importlib.util
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from thumper.camera.frame import CameraFrame
from thumper.camera.mjpeg import MjpegDecoder
from thumper.camera.open_camera import open_camera
from thumper.camera.options import CameraOptions
from thumper.camera.tags import find_tags, planar_pose, tag_poses
from thumper.common.errors import ThumperError
from thumper.common.geometry import Pose2, wrap_angle
from thumper.config.robot import RobotConfig, with_ports
from thumper.doctor.sensor_checks import check_sensors
from thumper.recording.reader import Recording
from thumper.recording.start_stop import recording_control
from thumper.ros import from_ros
from thumper.runtime.assembly import open_robot
from thumper_hil.bench import simulation

if importlib.util.find_spec("cv2") is None:
    pytest.skip("the extra `camera` is not installed", allow_module_level=True)

from thumper_hil.sensors.camera import Camera
from thumper_hil.sensors.camera_view import CameraView, tag_texture
from thumper_hil.world.paint import Paint
from thumper_hil.world.tag_shape import TagShape
from thumper_hil.world.world import World
from thumper_hil.world.world_file import WorldShapes

CAMERA = CameraOptions()
TAG = TagShape(number=7, x_m=-1.6, y_m=0.0, z_m=0.2, yaw_deg=0.0, size_m=0.1)


ROOM = replace(World.load("lab"), tags=(TAG,))


def frames(pose: Pose2, seed: int, count: int) -> bytes:
    """Bytes of a camera at `pose`."""
    device = Camera(
        pose_at=lambda times_s: np.tile((pose.x_m, pose.y_m, pose.theta_rad), (times_s.size, 1)),
        world=lambda: ROOM,
        seed=seed,
    )
    device.advance(0.1 * (count - 1) + 0.09)
    return device.read()


def config(name: str, options: str = "") -> RobotConfig:
    robot = RobotConfig(camera=CameraOptions(enabled=True))
    mission = f"world=charging&x_m=-0.6&y_m=0.0&yaw_deg=180{options}"
    return with_ports(robot, board=f"sim://{name}/board?{mission}", lidar=f"sim://{name}/lidar")


@pytest.mark.parametrize(
    ("distance_m", "side_deg", "error_m", "error_deg"),
    [(0.45, 0.0, 0.006, 3.0), (0.7, 20.0, 0.012, 3.0), (1.2, -30.0, 0.03, 4.0)],
)
def test_a_tag_is_found_where_it_is(
    distance_m: float, side_deg: float, error_m: float, error_deg: float
) -> None:
    side_rad = math.radians(side_deg)  # of the robot, seen from the tag
    base = Pose2(
        x_m=TAG.x_m + distance_m * math.cos(side_rad),
        y_m=distance_m * math.sin(side_rad),
        theta_rad=math.pi + side_rad,
    )
    true = base.inverse() @ Pose2(x_m=TAG.x_m, y_m=TAG.y_m)
    for seed in range(3):
        decoder = MjpegDecoder()
        (_, jpeg), *_ = decoder.feed(frames(base, seed, 1))
        (seen,) = find_tags(CameraFrame(time_s=0.0, jpeg=jpeg).grey())
        assert seen.number == TAG.number
        in_optical = tag_poses(seen.corners_px, TAG.size_m, CAMERA)
        poses = [planar_pose(CAMERA.base_from_optical() @ pose) for pose in in_optical]
        best = min(poses, key=lambda pose: abs(wrap_angle(pose.theta_rad - true.theta_rad)))
        assert best.distance_m(true) < error_m
        assert abs(wrap_angle(best.theta_rad - true.theta_rad)) < math.radians(error_deg)


PUBLISHED = """\
..........
.########.
.#..#.#.#.
.##...#.#.
.##..####.
.#.#.####.
.##.#..##.
.####.###.
.########.
.........."""  # tag36_11_00000.png of AprilRobotics/apriltag-imgs


def test_the_published_tag_stands_upright() -> None:
    """Both in the simulated world and in what the robot finds: OpenCV's tags are turned by 180 degrees."""
    cells = np.array([[255 * (cell == ".") for cell in row] for row in PUBLISHED.splitlines()], np.uint8)
    rendered = tag_texture(0, 1)
    assert np.array_equal(rendered > rendered.mean(), cells > 0)
    (seen,) = find_tags(np.pad(np.kron(cells, np.ones((20, 20), np.uint8)), 40, constant_values=255))
    assert seen.number == 0
    left_px, right_px = 40 + 20 - 0.5, 40 + 180 - 0.5
    expected = [(left_px, left_px), (right_px, left_px), (right_px, right_px), (left_px, right_px)]
    assert seen.corners_px == pytest.approx(np.array(expected), abs=0.05)


def test_a_coloured_box_is_seen_where_it_is_and_hides_what_is_behind() -> None:
    near, far = ((0.8, 0.0, 0.2, 0.2, 0.0), (1.6, 0.1, 0.2, 0.9, 0.0))  # x, y, length, width, yaw
    shapes = WorldShapes(
        segments=np.array([[3.0, -3.0, 3.0, 3.0]]),
        circles=np.zeros((0, 3)),
        boxes=(near, far),
        box_paints=(
            Paint(colour=(200, 0, 0), height_m=0.3),
            Paint(colour=(0, 0, 200), height_m=0.4),
        ),
    )
    view = CameraView((640, 480), CAMERA.matrix(), CAMERA.base_from_optical())
    image = view.render(World.from_shapes(shapes), Pose2())
    for (x_m, y_m, length_m, width_m, _), height_m, channel in ((near, 0.3, 2), (far, 0.4, 0)):
        face_m = x_m - 0.5 * length_m - CAMERA.x_m  # from the lens
        rows, columns = np.nonzero(image[..., channel] == 200.0)
        left_px, right_px = (
            CAMERA.cx_px - CAMERA.fx_px * (y_m + s * 0.5 * width_m) / face_m for s in (1, -1)
        )
        assert (columns.min(), columns.max()) == pytest.approx((left_px, right_px), abs=2.0)
        top_px = CAMERA.cy_px - CAMERA.fy_px * (height_m - CAMERA.z_m) / face_m
        assert rows.min() == pytest.approx(top_px, abs=2.0)
    assert image[240, 320].tolist() == [0.0, 0.0, 200.0]  # the near one
    assert len(set(image[240, 20].tolist())) == 1  # a grey wall


def test_damaged_bytes_cost_one_frame() -> None:
    data = bytearray(frames(Pose2(x_m=-0.8, theta_rad=math.pi), 1, 4))
    second = data.find(b"--frame", 100)
    data[second + 20 : second + 24] = b"\x00\xff\x00\xff"
    decoder = MjpegDecoder()
    parts = [bytes(data[start : start + 7000]) for start in range(0, len(data), 7000)]
    stamps_s = [stamp_s for part in parts for stamp_s, _ in decoder.feed(part)]
    assert np.diff(stamps_s) == pytest.approx([0.2, 0.1], abs=1e-6)
    assert decoder.bad == 1


def test_its_frames_are_recorded_at_a_bounded_rate(tmp_path: Path) -> None:
    settings = config("camera-recorded")
    with (
        open_robot(settings, Pose2()) as robot,
        recording_control(robot, settings, Pose2(), tmp_path, print) as control,
    ):
        control.start()
        while simulation("camera-recorded").time_s < 5.0:
            robot.step()
        recorder = control.close()
    assert recorder is not None
    recorded = list(Recording((recorder.files[0],)).messages())
    times_s = [from_ros.frame_of(each.decode()).time_s for each in recorded if each.topic == "camera"]
    assert 0.49 < np.diff(times_s).min() <= np.diff(times_s).max() < 0.61
    (info,) = (each.decode() for each in recorded if each.topic == "camera_info")
    assert info.k[0] == CAMERA.fx_px
    (static,) = (each.decode() for each in recorded if each.topic == "tf_static")
    mounted = static.transforms[1]
    assert mounted.child_frame_id == info.header.frame_id
    q = mounted.transform.rotation
    forward = (2.0 * (q.x * q.z + q.w * q.y), 2.0 * (q.y * q.z - q.w * q.x), 1.0 - 2.0 * (q.x**2 + q.y**2))
    assert forward == pytest.approx(CAMERA.base_from_optical()[:3, 2])


def test_the_doctor_reports_rate_and_size() -> None:
    (check,) = check_sensors(config("camera-doctor"), seconds=2.0)
    assert (check.verdict, check.fix) == ("pass", "")
    assert check.what == "camera: 10.0 Hz, 640 x 480 pixels, 0 damaged"


def test_a_camera_of_another_size_is_refused() -> None:
    wide = replace(config("camera-wide"), camera=CameraOptions(enabled=True, width_px=1280, height_px=720))
    wide = with_ports(wide, board="sim://camera-wide/board", lidar="sim://camera-wide/lidar")
    with pytest.raises(ThumperError, match=r"sends 640 x 480 pixels; correct \[camera\] width_px"):
        open_camera(wide.camera)


def test_an_absent_camera_is_refused_in_one_line() -> None:
    with pytest.raises(
        ThumperError, match="cannot open the camera port /dev/video77: there is no such"
    ) as refusal:
        open_camera(CameraOptions(port="/dev/video77"))
    assert refusal.value.exit_code == 3
    assert "\n" not in str(refusal.value)
