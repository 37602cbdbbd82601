"""Create the mapper that the configuration names."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Literal, Protocol, cast

from thumper.common.geometry import FloatArray, Pose2
from thumper.slam.grid.grid_mapper import GridMapper
from thumper.slam.grid.options import GridMapperOptions
from thumper.slam.mapper import Mapper
from thumper.slam.particle_filter.options import RbpfOptions
from thumper.slam.particle_filter.rbpf_mapper import RbpfMapper
from thumper.slam.pose_graph.graph_mapper import GraphMapper
from thumper.slam.pose_graph.loop_closure import LoopOptions

Method = Literal["slam", "scan_match", "rbpf"]
OLD_METHODS: Mapping[str, Method] = MappingProxyType({"graph": "slam"})
"""Names of earlier versions, which files and commands still accept."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MappingOptions(GridMapperOptions):
    """`[mapping]`: the method, and the options of all methods."""

    # `slam` closes loops; `scan_match` and `rbpf` are there for comparison.
    method: Method = "slam"
    loops: LoopOptions = field(default_factory=LoopOptions)
    filter: RbpfOptions = field(default_factory=RbpfOptions)


def method_named(name: str) -> Method:
    """Return the method of this name, which may be that of an earlier version."""
    return OLD_METHODS.get(name, cast("Method", name))


class PathMapper(Mapper, Protocol):
    """A mapper that keeps the whole path and can compile its kernels in advance."""

    def path(self) -> FloatArray:
        """Return x, y, theta at each scan, as corrected so far, shape (scans, 3)."""
        ...

    def resume_at(self, map_from_base: Pose2, map_from_odom: Pose2, covariance: FloatArray) -> None:
        """Continue in the same map from a pose that another estimator found at a newer scan."""
        ...

    def warm_up(self) -> None:
        """Compile the kernels, or load them from the cache."""
        ...


def make_mapper(
    options: MappingOptions, *, base_from_laser: Pose2 | None = None, map_from_base: Pose2 | None = None
) -> PathMapper:
    """Return the mapper named by `options.method`, with an empty map."""
    method = method_named(options.method)
    if method == "rbpf":
        return RbpfMapper(
            options, options.filter, base_from_laser=base_from_laser, map_from_base=map_from_base
        )
    if method == "slam":
        return GraphMapper(
            options, options.loops, base_from_laser=base_from_laser, map_from_base=map_from_base
        )
    return GridMapper(options, base_from_laser=base_from_laser, map_from_base=map_from_base)
