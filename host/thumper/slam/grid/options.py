"""Options of the mappers."""

from dataclasses import dataclass, field
from typing import Annotated

from annotated_types import Ge, Gt, Interval

from thumper.slam.scan_matching.gauss_newton import MatchOptions
from thumper.slam.scan_matching.pose_covariance import PoseCovarianceOptions


@dataclass(frozen=True, slots=True, kw_only=True)
class GridMapperOptions:
    """Options of `GridMapper`, which all mapping methods share."""

    resolution_m: Annotated[float, Interval(ge=0.005, le=1.0)] = 0.05  # side of a cell
    # Beams count up to this range, and never beyond 98 % of the sensor's own limit.
    usable_range_m: Annotated[float, Gt(0)] = 80.0
    integrate_distance_m: Annotated[float, Ge(0)] = 0.1  # insert a scan after this distance
    integrate_angle_rad: Annotated[float, Ge(0)] = 0.1  # insert a scan after this turn, too
    occupied_fraction: Annotated[float, Interval(gt=0, lt=1)] = 0.25  # share of hits of an occupied cell
    reach_m: Annotated[float, Gt(0)] = 0.5  # cut-off of the distance field: the basin of the matcher
    search_window_m: Annotated[float, Gt(0)] = 0.5  # half side of the search window
    search_window_rad: Annotated[float, Gt(0)] = 0.4  # half angle of the search window
    matching: MatchOptions = field(default_factory=MatchOptions)
    confidence: PoseCovarianceOptions = field(default_factory=PoseCovarianceOptions)
