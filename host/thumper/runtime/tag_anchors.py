"""AprilTags as anchors of a map: surveyed once while mapping, they show a localizing robot where it is.

A tag's number names it, so one view decides between places that look alike to the lidar.
"""

import math
from collections.abc import Callable, Iterable

from thumper.camera.frame import CameraFrame
from thumper.camera.options import CameraOptions
from thumper.camera.tag_tracker import TagTracker
from thumper.camera.tags import tags_in
from thumper.common.geometry import Pose2, wrap_angle
from thumper.common.texts import place_text
from thumper.maps.annotations import SavedTag
from thumper.slam.mapper import Mapper, Relocalizable, SwitchesMode

FRAMES = 8  # that show a tag, before its pose counts
FARTHEST_M = 2.0  # from the robot; the direction is 2.9 degrees rms there
LOOK_S = 1.0  # until the next frame, without a tag in view or after its pose: each costs 4 to 18 ms (PC)
GONE_S = 1.0  # after which a tag's frames are forgotten
NEARER_M = 0.1  # a view nearer by so much replaces the pose of a tag
OFF_M, OFF_RAD = 0.3, 0.2  # between the poses by tag and by lidar, from which the tag's counts
SETTLING_S = 10.0  # for the localizer to verify a pose


class TagAnchors:
    """Call `add` with frames. `known` returns the saved tags, `survey` saves one, `report` prints a line."""

    def __init__(
        self,
        camera: CameraOptions,
        size_m: float,
        *,
        known: Callable[[], Iterable[SavedTag]],
        survey: Callable[[SavedTag], None],
        report: Callable[[str], None],
    ) -> None:
        self._camera, self._size_m = camera, size_m
        self._known, self._survey, self._report = known, survey, report
        self._trackers: dict[int, TagTracker] = {}  # of the tags in view
        self._surveyed_m: dict[int, float] = {}  # nearest view of each tag that this run has surveyed
        self._looked_s = self._given_s = -math.inf

    def add(
        self,
        frame: CameraFrame,
        odom_at_frame: Pose2,
        odom_from_base: Pose2,
        map_from_odom: Pose2,
        mapper: Mapper,
    ) -> None:
        """Look at a frame; survey its tags while mapping, correct the pose by them while localizing."""
        if not self._trackers and frame.time_s < self._looked_s + LOOK_S:
            return
        self._looked_s = frame.time_s
        self._trackers = {
            number: tracker
            for number, tracker in self._trackers.items()
            if frame.time_s < tracker.newest_s + GONE_S
        }
        for tag in tags_in(frame, self._camera):
            tracker = self._trackers.setdefault(
                tag.number, TagTracker(tag.number, self._size_m, self._camera)
            )
            tracker.add_corners(frame.time_s, tag.corners_px, odom_at_frame)
            odom_from_tag = tracker.odom_from_tag
            if odom_from_tag is None or tracker.count < FRAMES:
                continue
            del self._trackers[tag.number]
            distance_m = odom_from_tag.distance_m(odom_at_frame)
            if distance_m > FARTHEST_M:
                continue
            if isinstance(mapper, SwitchesMode) and mapper.is_localizing:
                base_from_tag = odom_from_base.inverse() @ odom_from_tag
                self._correct(tag.number, base_from_tag, map_from_odom @ odom_from_base, mapper, frame.time_s)
            elif not mapper.quality().lost:
                self._measure(tag.number, map_from_odom @ odom_from_tag, distance_m)

    def _measure(self, number: int, at: Pose2, distance_m: float) -> None:
        """Save the pose of a new tag, or of one that is nearer than before; a loaded tag stays."""
        is_known = any(tag.number == number for tag in self._known())
        if is_known and distance_m > self._surveyed_m.get(number, -math.inf) - NEARER_M:
            return
        self._surveyed_m[number] = distance_m
        self._survey(SavedTag(number=number, x_m=at.x_m, y_m=at.y_m, yaw_rad=at.theta_rad))
        if not is_known:
            self._report(f"tag {number} is at {place_text(at.x_m, at.y_m)}")

    def _correct(
        self, number: int, base_from_tag: Pose2, by_lidar: Pose2, mapper: Mapper, time_s: float
    ) -> None:
        """Give the localizer the pose by a known tag, if it has none or one that contradicts the tag."""
        saved = next((tag for tag in self._known() if tag.number == number), None)
        if saved is None or time_s < self._given_s + SETTLING_S or not isinstance(mapper, Relocalizable):
            return
        map_from_tag = Pose2(x_m=saved.x_m, y_m=saved.y_m, theta_rad=saved.yaw_rad)
        by_tag = map_from_tag @ base_from_tag.inverse()
        is_near = by_tag.distance_m(by_lidar) < OFF_M
        if (
            is_near
            and abs(wrap_angle(by_tag.theta_rad - by_lidar.theta_rad)) < OFF_RAD
            and not mapper.quality().lost
        ):
            return
        self._given_s = time_s
        mapper.set_pose(by_tag)
        degrees = math.degrees(by_tag.theta_rad)
        self._report(f"pose by tag {number}: {place_text(by_tag.x_m, by_tag.y_m)}, {degrees:z.0f} degrees")
