"""Fetch and build other projects' code, to run it beside ours. Nothing of it is part of this repository."""

import subprocess
from dataclasses import dataclass
from functools import partial
from pathlib import Path

HERE = Path(__file__).resolve().parent
OUT = HERE.parents[1] / "out" / "peers"
FLAGS = ("-O3", "-DNDEBUG", "-march=native", "-w", "-fPIC", "-shared")
EIGEN = Path("/usr/include/eigen3")
ROSCPP = Path("/usr/include/ros/ros.h")
ROS_LIBRARIES = (
    "roscpp",
    "rosconsole",
    "rostime",
    "roscpp_serialization",
    "xmlrpcpp",
    "tf2_ros",
    "boost_thread",
)
LOCAL_PLANNER = (
    *("simple_trajectory_generator", "simple_scored_sampling_planner", "map_grid_cost_function", "map_grid"),
    *("map_cell", "obstacle_cost_function", "costmap_model", "oscillation_cost_function", "trajectory"),
    *("twirling_cost_function", "footprint_helper"),
)
COSTMAP = ("costmap_2d", "layer", "layered_costmap", "costmap_math", "footprint", "array_parser")


@dataclass(frozen=True, slots=True, kw_only=True)
class Source:
    """A repository at a commit."""

    url: str
    commit: str
    folders: tuple[str, ...] = (".",)  # those that are needed

    def fetch(self) -> Path:
        """Fetch it once; return its folder. Raises CalledProcessError if that fails."""
        folder = OUT / self.commit[:12]
        if not all((folder / name).exists() for name in (".complete", *self.folders)):
            folder.mkdir(parents=True, exist_ok=True)
            for command in (
                ("init", "--quiet"),
                ("fetch", "--quiet", "--depth", "1", self.url, self.commit),
                ("checkout", "--quiet", "FETCH_HEAD", "--", *self.folders),
            ):
                subprocess.run(["git", *command], cwd=folder, check=True)
            (folder / ".complete").touch()
        return folder


NAVIGATION = Source(  # BSD; ROS 1 Noetic, 1.17.3
    url="https://github.com/ros-planning/navigation",
    commit="9ad644198e132d0e950579a3bc72c29da46e60b0",
    folders=("navfn", "costmap_2d", "base_local_planner"),
)
GMAPPING = Source(  # BSD
    url="https://github.com/ros-perception/openslam_gmapping",
    commit="5105476edb125bd3e05df3583b5817c486238dec",
)
LAMA = Source(  # BSD
    url="https://github.com/iris-ua/iris_lama",
    commit="fd60e55db67f59114a4ff0443519b34d484f92cf",
)
# Why the others are not here.
NOT_BUILT = {
    "Cartographer, slam_toolbox": "they need Ceres, Abseil, Lua or ROS 2",
}
EXPORTS = {  # headers that gmapping's build generates
    "gridfastslam": "gridfastslam",
    "scanmatcher": "scanmatcher",
    "utils": "utils",
    "log": "log",
    "sensor/sensor_base": "sensor_base",
    "sensor/sensor_odometry": "sensor_odometry",
    "sensor/sensor_range": "sensor_range",
}


def build_navfn() -> Path:
    """Fetch and build navfn; return the library. Raises CalledProcessError or FileNotFoundError."""
    folder = NAVIGATION.fetch() / "navfn"
    files = [HERE / "navfn.cpp", folder / "src" / "navfn.cpp"]
    return _build("navfn", files, [HERE / "stub_navfn", folder / "include"])


def build_dwa() -> Path:
    """Fetch and build costmap_2d's inflation and DWA's critics; return the library.

    Raises CalledProcessError or FileNotFoundError.
    """
    if not ROSCPP.exists():
        raise FileNotFoundError(f"{ROSCPP}; install libroscpp-dev libtf2-ros-dev libeigen3-dev")
    folder = NAVIGATION.fetch()
    local, costmap = folder / "base_local_planner", folder / "costmap_2d"
    files = [
        HERE / "dwa.cpp",
        *(local / "src" / f"{name}.cpp" for name in LOCAL_PLANNER),
        *(costmap / "src" / f"{name}.cpp" for name in COSTMAP),
        costmap / "plugins" / "inflation_layer.cpp",
    ]
    folders = [HERE / "stub", local / "include", costmap / "include", EIGEN]
    return _build("dwa", files, folders, ROS_LIBRARIES)


def build_gmapping() -> Path:
    """Fetch and build gmapping; return the library. Raises CalledProcessError or FileNotFoundError."""
    folder, exports = GMAPPING.fetch(), OUT / "gmapping_exports"
    for place, name in EXPORTS.items():
        header = exports / "gmapping" / place / f"{name}_export.h"
        header.parent.mkdir(parents=True, exist_ok=True)
        header.write_text(f"#define {name.upper()}_EXPORT\n", encoding="utf-8")
    patterns = (
        "utils/stat.cpp",
        "utils/movement.cpp",
        "sensor/*/*.cpp",
        "scanmatcher/smmap.cpp",
        "scanmatcher/scanmatcher.cpp",
        "scanmatcher/eig3.cpp",
        "gridfastslam/gridslamprocessor*.cpp",
        "gridfastslam/motionmodel.cpp",
    )
    files = [HERE / "gmapping.cpp", *(file for pattern in patterns for file in folder.glob(pattern))]
    return _build("gmapping", files, [exports, folder / "include"])


def build_lama() -> Path:
    """Fetch and build LaMa; return the library. Raises CalledProcessError or FileNotFoundError."""
    if not EIGEN.exists():
        raise FileNotFoundError(f"{EIGEN}; install libeigen3-dev")
    folder = LAMA.fetch()
    vendor = folder / "vendor"
    zstd = _build_c("zstd", [*vendor.glob("zstd/zstd/*.c"), *vendor.glob("lz4/lz4/*.c")], [])
    unused = ("graph_slam2d", "simple_pgo", "lidar_odometry_2d", "loc2d")
    files = [file for file in folder.glob("src/**/*.cpp") if file.stem not in unused]
    folders = [folder / "include", EIGEN, *(vendor / name for name in ("lz4", "zstd", "stb", "moodycamel"))]
    return _build("lama", [HERE / "lama.cpp", *files, zstd], folders)


def _compile(
    compiler: str, name: str, files: list[Path], folders: list[Path], libraries: tuple[str, ...] = ()
) -> Path:
    library = OUT / f"lib{name}.so"
    newest_s = max(file.stat().st_mtime for file in (Path(__file__), *files))
    if library.exists() and library.stat().st_mtime > newest_s:
        return library
    standard = ("-std=gnu++17",) if compiler == "g++" else ()
    includes = (f"-I{folder}" for folder in folders)
    outputs = ("-o", str(library), f"-Wl,-rpath,{OUT}", "-lpthread", *(f"-l{name}" for name in libraries))
    subprocess.run([compiler, *FLAGS, *standard, *includes, *map(str, files), *outputs], check=True)
    return library


_build, _build_c = partial(_compile, "g++"), partial(_compile, "gcc")
