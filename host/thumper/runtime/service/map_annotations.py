"""The zones and places of the map in use: clients change them, the navigator obeys them at once."""

import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from thumper.common.errors import ThumperError
from thumper.maps.annotations import Annotations, SavedPlace, SavedTag, Zone, parse_feature
from thumper.navigation.costmap.filters import KEEPOUT_PERCENT
from thumper.navigation.costmap.zones import zone_masks
from thumper.navigation.footprint import Footprint
from thumper.navigation.goal import Goal
from thumper.navigation.navigator import Navigator
from thumper.ros.services import RemoveAnnotation, Text
from thumper.ros.to_ros import text
from thumper.runtime.drive.goal_limits import GoalLimits
from thumper.runtime.publisher import Publisher
from thumper.runtime.state_estimator import StateEstimator


class MapAnnotations:
    """Holds, changes and publishes them."""

    def __init__(
        self,
        annotations: Annotations,
        *,
        navigator: Navigator,
        estimator: StateEstimator,
        footprint: Footprint,
        publisher: Publisher,
    ) -> None:
        """Start with those that were saved with the map."""
        self._navigator = navigator
        self._estimator = estimator
        self.footprint = footprint
        self._publisher = publisher
        self.value = Annotations()
        self.replace(annotations)

    def replace(self, annotations: Annotations) -> None:
        """Use these from the next control cycle on, and publish them."""
        if annotations.zones != self.value.zones:
            self._navigator.set_filters(zone_masks(annotations.zones))
        self.value = annotations
        self._publisher.publish_text("annotations", text(json.dumps(annotations.to_geojson())))
        self._publisher.publish_markers(annotations)

    def survey(self, tag: SavedTag) -> None:
        """Add a tag, or replace the one of its number."""
        self.replace(self.value.with_item(tag))

    def add(self, feature: Mapping[str, Any], _source: str = "") -> Text:
        """Add a zone or place, or replace the one of its name; raise ThumperError if it is wrong."""
        item = parse_feature(feature)
        changed = self.value.with_item(item)
        if isinstance(item, Zone):
            self._refuse_under_robot(item)
        name = item.name or changed.zones[-1].name
        verb = "changed" if item.name and self.value.find(item.name) else "added"
        self.replace(changed)
        doubt = self._doubt(item) if isinstance(item, SavedPlace) else ""
        return self._say(f"{verb} {_kind(item)} {name!r}{doubt}")

    def remove(self, request: RemoveAnnotation, _source: str = "") -> Text:
        """Remove a zone or place; raise ThumperError if there is none of that name."""
        item = self.value.find(request.name)
        self.replace(self.value.without(request.name))
        assert item is not None  # else `without` has raised
        return self._say(f"removed {_kind(item)} {item.name!r}")

    def _doubt(self, place: SavedPlace) -> str:
        """Return why the robot cannot drive to a place, by the map so far; empty if it can."""
        if self._estimator.state() is None:
            return ""
        limits = GoalLimits(estimator=self._estimator, navigator=self._navigator)
        try:
            limits.check_in_map(Goal(x_m=place.x_m, y_m=place.y_m))
        except ThumperError as refusal:
            return f"; the robot cannot drive there: {refusal}"
        return ""

    def _refuse_under_robot(self, zone: Zone) -> None:
        """Refuse a keep-out zone that the robot is in: it could not leave it."""
        state = self._estimator.state()
        if state is None:
            return
        for mask in zone_masks([zone]).keepout:
            row, col = np.nonzero(mask.cells >= KEEPOUT_PERCENT)
            x_m = mask.origin_x_m + (col + 0.5) * mask.resolution_m
            y_m = mask.origin_y_m + (row + 0.5) * mask.resolution_m
            in_base = state.map_from_base.inverse().apply(np.column_stack((x_m, y_m)))
            planes = self.footprint.half_planes()
            margin_m = mask.resolution_m / math.sqrt(2.0)
            if (in_base @ planes[:, :2].T < planes[:, 2] + margin_m).all(axis=1).any():
                raise ThumperError(
                    "the robot is in this keep-out zone: draw it beside the robot, or drive away first"
                )

    def _say(self, line: str) -> Text:
        self._publisher.publish_event(line)
        return Text(text=line)


def _kind(item: object) -> str:
    if isinstance(item, SavedTag):
        return "tag"
    if not isinstance(item, Zone):
        return "place"
    return "keep-out zone" if item.kind.value == "keepout" else f"slow zone ({item.speed_percent} %)"
