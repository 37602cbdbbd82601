"""Create the mapper that the configuration names."""

from dataclasses import dataclass, field
from typing import Literal, Protocol

from thumper.common.geometry import FloatArray, Pose2
from thumper.slam.grid.grid_mapper import GridMapper
from thumper.slam.grid.options import GridMapperOptions
from thumper.slam.mapper import Mapper
from thumper.slam.particle_filter.options import RbpfOptions
from thumper.slam.particle_filter.rbpf_mapper import RbpfMapper
from thumper.slam.pose_graph.graph_mapper import GraphMapper
from thumper.slam.pose_graph.loop_closure import LoopOptions

Method = Literal["scan_match", "graph", "rbpf"]


@dataclass(frozen=True, slots=True, kw_only=True)
class MappingOptions(GridMapperOptions):
    """`[mapping]`: the method, and the options of all methods."""

    # The cheapest method. No loop closure moves the pose of a moving robot.
    method: Method = "scan_match"
    loops: LoopOptions = field(default_factory=LoopOptions)
    filter: RbpfOptions = field(default_factory=RbpfOptions)


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
    if options.method == "rbpf":
        return RbpfMapper(
            options, options.filter, base_from_laser=base_from_laser, map_from_base=map_from_base
        )
    if options.method == "graph":
        return GraphMapper(
            options, options.loops, base_from_laser=base_from_laser, map_from_base=map_from_base
        )
    return GridMapper(options, base_from_laser=base_from_laser, map_from_base=map_from_base)
