"""Moving pictures of drives, from real recordings of the simulated robot's messages."""

from pathlib import Path

import numpy as np
import pytest
from benchmarks.shared.recorded_run import RUN, cycles
from PIL import Image

from tests.variants import some_of
from thumper.common.colours import BLUE, FREE_COLOUR, RED
from thumper.common.errors import ThumperError
from thumper.recording.animation import LONG_SIDE_PX, animate
from thumper.recording.reader import Recording
from thumper.recording.recorder import Recorder


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    """6 s of driving straight ahead."""
    recorder = Recorder(tmp_path_factory.mktemp("drive"), RUN)
    for topic, now_s, message in cycles(60):
        recorder(topic, now_s, message)
    recorder.close()
    return Recording(tuple(recorder.files))


def robot_at_px(frame: Image.Image) -> np.ndarray:
    """Return the median of the robot's pixels: column, row."""
    colour = np.array([int(BLUE[i : i + 2], 16) for i in (1, 3, 5)])
    is_robot = np.abs(np.asarray(frame.convert("RGB")).astype(int) - colour).max(axis=2) < 40
    rows, columns = np.nonzero(is_robot)
    return np.array([np.median(columns), np.median(rows)])


@pytest.mark.parametrize("suffix", some_of([".webp", ".gif"]))
def test_robot_moves_through_the_frames(drive: Recording, tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"drive{suffix}"
    frames = animate(drive, path, speed=4.0)
    with Image.open(path) as picture:
        assert max(picture.size) == LONG_SIDE_PX
        assert 15 <= frames <= 22  # 5.9 s, 4 times as fast, 12 frames per second
        places = []
        for index in (0, getattr(picture, "n_frames", 1) - 1):
            picture.seek(index)
            places.append(robot_at_px(picture))
    way_px = places[1] - places[0]
    assert way_px[0] > 20
    assert abs(way_px[1]) < 10


def test_first_frame_has_a_map_and_a_scan(drive: Recording, tmp_path: Path) -> None:
    animate(drive, tmp_path / "drive.webp", speed=1.0)
    with Image.open(tmp_path / "drive.webp") as picture:
        pixels = np.asarray(picture.convert("RGB")).astype(int)
    for colour in (FREE_COLOUR, RED):
        rgb = [int(colour[i : i + 2], 16) for i in (1, 3, 5)]
        assert (np.abs(pixels - rgb).max(axis=2) < 40).sum() > 5, colour


def test_long_drive_is_played_faster(
    drive: Recording, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("thumper.recording.animation.MAX_FRAMES", 10)
    assert animate(drive, tmp_path / "drive.gif", speed=1.0) <= 11


def test_recording_of_another_program_is_refused(drive: Recording, tmp_path: Path) -> None:
    drive = Recording(drive.paths)
    drive.metadata = {}
    with pytest.raises(ThumperError, match="another program recorded it"):
        animate(drive, tmp_path / "drive.gif", speed=1.0)
    assert not list(tmp_path.iterdir())
