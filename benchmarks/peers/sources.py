"""Fetch and build other projects' code, to run it beside ours. Nothing of it is part of this repository."""

import subprocess
from dataclasses import dataclass
from pathlib import Path

HERE = Path(__file__).resolve().parent
OUT = HERE.parents[1] / "out" / "peers"
FLAGS = ("-O3", "-DNDEBUG", "-march=native", "-w", "-fPIC", "-shared", "-std=gnu++17")


@dataclass(frozen=True, slots=True, kw_only=True)
class Source:
    """A repository at a commit."""

    url: str
    commit: str
    folders: tuple[str, ...]  # those that are needed

    def fetch(self) -> Path:
        """Fetch it once; return its folder. Raises CalledProcessError if that fails."""
        folder = OUT / self.commit[:12]
        if not (folder / ".complete").exists():
            folder.mkdir(parents=True, exist_ok=True)
            for command in (
                ("init", "--quiet"),
                ("fetch", "--quiet", "--depth", "1", self.url, self.commit),
                ("checkout", "--quiet", "FETCH_HEAD", "--", *self.folders),
            ):
                subprocess.run(["git", *command], cwd=folder, check=True)
            (folder / ".complete").touch()
        return folder


NAVIGATION = Source(  # BSD; ROS 1 Noetic, navfn 1.17.3
    url="https://github.com/ros-planning/navigation",
    commit="9ad644198e132d0e950579a3bc72c29da46e60b0",
    folders=("navfn",),
)
# Why the others are not here.
NOT_BUILT = {
    "costmap_2d's inflation layer": "it needs boost, pluginlib, dynamic_reconfigure and roscpp",
    "dwa_local_planner's critics": "they need the same, and tf2",
    "gmapping, LaMa": "their drivers are not written; LaMa needs Eigen",
}


def build_navfn() -> Path:
    """Fetch and build navfn; return the library. Raises CalledProcessError or FileNotFoundError."""
    folder, library = NAVIGATION.fetch() / "navfn", OUT / "navfn.so"
    files = [HERE / "navfn.cpp", folder / "src" / "navfn.cpp"]
    folders = [f"-I{HERE / 'stub'}", f"-I{folder / 'include'}"]
    subprocess.run(["g++", *FLAGS, *folders, *files, "-o", library], check=True)
    return library
