"""Tables from recordings: scans of different lengths, and disks that are full."""

import csv
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from benchmarks.shared.recorded_run import MESSAGES, RUN, cycles

from thumper.lidar.scan import Scan
from thumper.recording.export import export_csv
from thumper.recording.reader import Recording
from thumper.recording.recorder import Recorder


def recorded_scans(folder: Path, lengths: list[int]) -> Recording:
    """Record scans with as many beams as given, as an LD19 sends them."""
    recorder = Recorder(folder, RUN)
    for k, length in enumerate(lengths):
        ranges_m = np.arange(length, dtype=np.float64) + 1000.0 * k
        scan = Scan(time_s=float(k), ranges_m=ranges_m, angle_min_rad=0.0, angle_increment_rad=0.01)
        recorder("scan", float(k), MESSAGES.scan(scan))
    recorder.close()
    return Recording(tuple(recorder.files))


@pytest.mark.parametrize("lengths", [[450, 455, 448, 456, 450], [3, 2, 4]])
def test_every_beam_of_every_scan_is_exported(tmp_path: Path, lengths: list[int]) -> None:
    (file,) = export_csv(recorded_scans(tmp_path, lengths), tmp_path)
    with file.open(newline="", encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    for k, (row, length) in enumerate(zip(rows, lengths, strict=True)):
        ranges = [row[f"ranges.{beam}"] for beam in range(max(lengths))]
        assert [float(value) for value in ranges[:length]] == [1000.0 * k + beam for beam in range(length)]
        assert set(ranges[length:]) <= {""}
    beams = [name for name in rows[0] if name.startswith("ranges.")]
    assert beams == [f"ranges.{beam}" for beam in range(max(lengths))]  # in order, the longest scan's


EXPORT = """
import resource, sys
from pathlib import Path
from thumper.common.errors import ThumperError
from thumper.recording.export import export_csv
from thumper.recording.reader import Recording

resource.setrlimit(resource.RLIMIT_FSIZE, (4000, 4000))
try:
    export_csv(Recording((Path(sys.argv[1]),)), Path(sys.argv[2]))
except ThumperError as error:
    print(error)
"""


def test_full_disk_keeps_the_tables_of_an_earlier_export(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path, RUN)
    for topic, now_s, message in cycles(30):
        recorder(topic, now_s, message)
    recorder.close()
    tables = tmp_path / "tables"
    tables.mkdir()
    export_csv(Recording(tuple(recorder.files)), tables)
    before = {path: path.read_bytes() for path in tables.iterdir()}
    assert len(before) >= 9
    done = subprocess.run(
        [sys.executable, "-c", EXPORT, recorder.files[0], tables], capture_output=True, text=True, check=True
    )
    assert done.stdout == f"{tables}: cannot write (File too large); choose another folder\n"
    assert {path: path.read_bytes() for path in tables.iterdir()} == before
