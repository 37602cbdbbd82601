"""Campaigns: file validation, stored rows after a kill, and drives on workers of which one dies."""

import math
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from distributed import LocalCluster

from thumper.common.errors import ThumperError
from thumper_hil.campaign import runner
from thumper_hil.campaign.job import run_job
from thumper_hil.campaign.result_row import MEASURES, CampaignRow
from thumper_hil.campaign.result_table import RowStore
from thumper_hil.campaign.spec import campaign_digest, expand_jobs, load_campaign
from thumper_hil.campaign.summary import markdown, mean_interval, summarise, wilson
from thumper_hil.world.world_file import WORLDS

FILE = """
seeds = { first = 3, count = 2 }
parameters = [{ name = "default" }, { name = "gentle", robot = "gentle.toml" }]

[[missions]]
name = "step"
world = "lab"
start = [1.0, 0.0, 180.0]
via = [[0.8, 0.0]]
goal = [0.6, 0.0]
"""
BIN = Path(sys.executable).parent
ROOT = Path(__file__).parents[2]


def written(folder: Path, text: str = FILE) -> Path:
    (folder / "gentle.toml").write_text("[navigation.limits]\nv_max_m_s = 0.3\n")
    path = folder / "campaign.toml"
    path.write_text(text)
    return path


def row(key: str, **changed: object) -> CampaignRow:
    numbers = dict.fromkeys(MEASURES, 0.25)
    fixed = {"key": key, "mission": "m", "parameters": "p", "seed": 1, "reached": True, "contacts": 0}
    return CampaignRow(**(numbers | fixed | {"reason": 'said "so", and more'} | changed))  # type: ignore[arg-type]


def test_jobs_cover_all_missions_seeds_and_parameter_sets(tmp_path: Path) -> None:
    jobs = expand_jobs(load_campaign(written(tmp_path)), tmp_path)
    assert [job.key for job in jobs[:3]] == ["step/default/3", "step/gentle/3", "step/default/4"]
    assert len(jobs) == len({job.key for job in jobs}) == 4
    assert '"v_max_m_s":0.3' in jobs[1].robot_json


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('world = "lab"', 'world = "moon"', "moon"),
        ("count = 2", "count = 0", "seeds.count"),
        ("count = 2", "count = 1000000000", "seeds.count"),
        ("goal = ", "gaol = ", "missions.0.goal"),
        ("[0.6, 0.0]", '"there"', "goal"),
        ('"gentle.toml"', '"none.toml"', "none.toml"),
        ('name = "gentle"', 'name = "default"', "same name"),
        ('robot = "gentle.toml"', 'scenario = "gentle.toml"', "gentle.toml"),
        ("seeds = ", 'show = ["luck"]\nseeds = ', "show.*goal_error_m"),
        ('name = "step"', 'name = "step #1"', "missions.0.name.*letters"),
        ('name = "step"', 'name = "a/b"', "letters"),
        ('name = "step"', 'name = ""', "letters"),
        ('name = "gentle"', 'name = "50% | pipe?"', "parameters.1.name.*letters"),
        ("[1.0, 0.0, 180.0]", "[100.0, 0.0, 180.0]", "step: .*outside the room"),
        ("[1.0, 0.0, 180.0]", "[1.0, nan, 180.0]", "missions.0.start"),
        ("[1.0, 0.0, 180.0]", "[1.0, 0.0, 1800.0]", "heading"),
        ("[0.6, 0.0]", "[60.0, 0.0]", "more than 50 m"),
        ("seeds =", "seeds", "TOML"),
    ],
)
def test_invalid_campaign_file_is_reported_in_one_line(tmp_path: Path, old: str, new: str, says: str) -> None:
    with pytest.raises(ThumperError, match=says) as caught:
        expand_jobs(load_campaign(written(tmp_path, FILE.replace(old, new))), tmp_path)
    assert caught.value.exit_code == 2
    assert "\n" not in str(caught.value)


def test_removed_key_in_a_robot_file_is_refused_with_the_fix(tmp_path: Path) -> None:
    path = written(tmp_path)
    (tmp_path / "gentle.toml").write_text("[recording]\nwaiting_messages = 16\n")
    with pytest.raises(ThumperError) as caught:
        expand_jobs(load_campaign(path), tmp_path)
    assert str(caught.value) == (
        f"{tmp_path / 'gentle.toml'}: recording.waiting_messages was removed: "
        "it is fixed at 4096 messages; delete the key"
    )
    assert caught.value.exit_code == 2


def test_rows_survive_a_kill_without_duplicates(tmp_path: Path) -> None:
    with RowStore(tmp_path, "d") as store:
        store.add(row("a"))
        store.add(row("b", goal_error_m=math.nan))
    whole = (tmp_path / "rows.csv").read_bytes()
    for cut in range(whole.index(b"\na,") + 1, len(whole), 5):
        (tmp_path / "rows.csv").write_bytes(whole[:cut])
        with RowStore(tmp_path, "d") as store:
            keys = [r.key for r in store.rows]
            assert keys in (["a"], [])
            store.add(row("c"))
        with RowStore(tmp_path, "d") as store:
            assert [r.key for r in store.rows] == [*keys, "c"]


def test_folder_of_another_campaign_is_refused(tmp_path: Path) -> None:
    with RowStore(tmp_path, "d"):
        pass
    with pytest.raises(ThumperError, match="another campaign"):
        RowStore(tmp_path, "e")


def test_more_seeds_continue_the_same_campaign(tmp_path: Path) -> None:
    few = expand_jobs(load_campaign(written(tmp_path)), tmp_path)
    more = expand_jobs(load_campaign(written(tmp_path, FILE.replace("count = 2", "count = 9"))), tmp_path)
    other = expand_jobs(load_campaign(written(tmp_path, FILE.replace("[0.6,", "[0.5,"))), tmp_path)
    assert campaign_digest(few) == campaign_digest(more) != campaign_digest(other)


def test_digest_depends_on_file_content_not_on_paths(tmp_path: Path) -> None:
    """Editing world, base map, scenario or masks makes a new campaign; moving the files does not."""
    text = FILE.replace('world = "lab"', 'world = "room.toml"').replace(
        '{ name = "default" }', '{ name = "default", scenario = "slip.toml" }'
    )

    def digest(folder: str, **changed: str) -> str:
        here = tmp_path / folder
        here.mkdir()
        image = changed.get("image", "P2 3 1 255 255 255 255\n")
        files = {
            "slip.toml": "faults = [{ at_s = 0.5, slip.left = 0.7 }]",
            "base.toml": 'map = "map.yaml"\n[[wall]]\npoints_m = [[-3, -3], [3, -3]]\n',
            "room.toml": 'base = "base"\n[[circle]]\nx_m = -2\ny_m = 0\nradius_m = 0.1\n',
            "map.yaml": "image: map.pgm\nresolution: 9.0\norigin: [-13.5, -4.5, 0.0]\nnegate: 0\n"
            "occupied_thresh: 0.65\nfree_thresh: 0.25\n",
            "mask.yaml": "image: mask.pgm\nresolution: 1.0\norigin: [7.0, 0.0, 0.0]\nnegate: 0\n"
            "occupied_thresh: 0.65\nfree_thresh: 0.25\n",
            "map.pgm": image,
            "mask.pgm": changed.get("mask", "P2 1 1 255 255\n"),
        } | {f"{name}.toml": text for name, text in changed.items() if name not in ("image", "mask")}
        for name, content in files.items():
            (here / name).write_text(content)
        path = written(here, text)
        (here / "gentle.toml").write_text('[navigation.masks]\nkeepout = "mask.yaml"\n')
        return campaign_digest(expand_jobs(load_campaign(path), here))

    first = digest("a")
    assert digest("b") == first
    assert digest("c", slip="faults = [{ at_s = 0.5, motor.left = 'dead' }]") != first
    assert digest("d", room='base = "base"\n[[circle]]\nx_m = -2\ny_m = 0\nradius_m = 0.2\n') != first
    assert digest("e", base='map = "map.yaml"\n[[wall]]\npoints_m = [[-3, -3], [4, -3]]\n') != first
    assert digest("f", image="P2 3 1 255 0 255 255\n") != first
    assert digest("g", mask="P2 1 1 255 0\n") != first


def test_second_process_in_the_same_folder_is_refused(tmp_path: Path) -> None:
    with RowStore(tmp_path, "d") as store:
        with pytest.raises(ThumperError, match="is writing to this folder") as caught:
            RowStore(tmp_path, "d")
        store.add(row("a"))
    assert caught.value.exit_code == 2
    with RowStore(tmp_path, "d") as store:
        assert [r.key for r in store.rows] == ["a"]


def test_rows_with_wrong_columns_are_refused(tmp_path: Path) -> None:
    (tmp_path / "rows.csv").write_text("key,mission\na,b\n")
    with pytest.raises(ThumperError, match="not the rows"):
        RowStore(tmp_path, "d")


def test_job_that_cannot_be_simulated_raises(tmp_path: Path) -> None:
    """A world that is edited or deleted after the jobs were created is an error, not a row."""
    (tmp_path / "room.toml").write_text(f'base = "{WORLDS / "lab"}"\n')
    jobs = expand_jobs(load_campaign(written(tmp_path, FILE.replace('"lab"', '"room.toml"'))), tmp_path)
    with (tmp_path / "room.toml").open("a") as stream:
        stream.write("[[circle]]\nx_m = 0.8\ny_m = 0\nradius_m = 0.1\n")
    with pytest.raises(ThumperError, match="same files"):
        run_job(jobs[0])
    (tmp_path / "room.toml").unlink()
    with pytest.raises(ThumperError, match="unknown world"):
        run_job(jobs[0])


def test_intervals_have_their_nominal_coverage() -> None:
    """About 95 of 100 intervals contain the true value."""
    rng = np.random.default_rng(1)
    means = [mean_interval(list(rng.normal(3.0, 1.0, 30))) for _ in range(100)]
    assert 88 <= sum(m.low < 3.0 < m.high for m in means) <= 100
    shares = [wilson(int(rng.binomial(40, 0.9)), 40) for _ in range(300)]
    assert 270 <= sum(s.low < 0.9 < s.high for s in shares) <= 300
    assert wilson(10, 10).high == pytest.approx(1.0)
    assert wilson(10, 10).low == pytest.approx(0.722, abs=0.001)
    assert math.isnan(mean_interval([math.nan]).value)
    three = mean_interval([2.0, 1.0, 6.0])  # too few for a confidence interval: the range
    assert (three.value, three.low, three.high) == (3.0, 1.0, 6.0)


def test_drive_with_a_contact_is_not_a_success() -> None:
    summary = summarise([row("a"), row("b", contacts=2), row("c", reached=False)], ["time_s"])[0]
    assert (summary.runs, summary.contacts) == (3, 2)
    assert summary.success.value == pytest.approx(1 / 3)


def test_means_exclude_drives_that_missed_the_goal() -> None:
    rows = [row("a"), row("b", reached=False, time_s=99.0)]
    assert summarise(rows, ["time_s"])[0].means["time_s"].value == pytest.approx(0.25)
    assert "reached their goal" in markdown(summarise(rows, ["time_s"]))


def test_missing_mean_is_printed_as_a_dash() -> None:
    assert markdown(summarise([row("b", reached=False)], ["time_s"])).splitlines()[2].endswith("| - |")


def test_documented_example_runs(tmp_path: Path) -> None:
    """The documented example runs with the files from `campaigns/` that it names."""
    page = (ROOT / "docs" / "howto" / "campaign.md").read_text()
    (tmp_path / "example.toml").write_text(page.split("```toml\n")[1].split("```")[0])
    for name in ("rbpf.toml", "slip.toml"):
        shutil.copy(ROOT / "campaigns" / name, tmp_path)
    jobs = expand_jobs(load_campaign(tmp_path / "example.toml"), tmp_path)
    result = run_job(jobs[0])
    assert result.reached, result.reason


def test_tour_with_a_fault_reaches_its_goal(tmp_path: Path) -> None:
    """The robot drives from x = 1 via 1.3 to 0.6 while the wheels of one side slip."""
    (tmp_path / "slip.toml").write_text("faults = [{ at_s = 0.5, slip.left = 0.7 }]")
    plain = 'parameters = [{ name = "default" }, { name = "gentle", robot = "gentle.toml" }]'
    slips = 'parameters = [{ name = "intact" }, { name = "slips", scenario = "slip.toml" }]'
    text = FILE.replace(plain, slips).replace("via = [[0.8, 0.0]]", "via = [[1.3, 0.0]]")
    jobs = expand_jobs(load_campaign(written(tmp_path, text)), tmp_path)
    intact, slipping = (run_job(job) for job in jobs[:2])
    assert intact.reached, intact.reason
    assert slipping.reached, slipping.reason
    assert 0.8 < intact.path_length_m < 2.0
    assert slipping.odometry_error_m > 1.5 * intact.odometry_error_m
    (summary,) = summarise([slipping], ["path_length_m", "pose_max_m"])
    assert list(summary.means) == ["path_length_m", "pose_max_m"]
    assert "| path length [m] | SLAM pose error, worst [m] |" in markdown([summary])


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """Start a scheduler and two workers, each in its own process."""
    file = tmp_path / "scheduler.json"
    scheduler = subprocess.Popen(
        [BIN / "dask", "scheduler", "--port", "0", "--no-dashboard", "--scheduler-file", file],
        stderr=subprocess.DEVNULL,
    )
    workers: list[subprocess.Popen[bytes]] = []
    try:
        while not file.exists() or '"address"' not in file.read_text():
            assert scheduler.poll() is None
            time.sleep(0.1)
        command: list[str | Path] = [
            BIN / "dask",
            "worker",
            "--scheduler-file",
            file,
            "--nthreads",
            "1",
            "--no-dashboard",
            "--no-nanny",  # a nanny would restart a killed worker
        ]
        workers += [subprocess.Popen(command, stderr=subprocess.DEVNULL, cwd=tmp_path) for _ in range(2)]
        address = file.read_text().split('"address": "')[1].split('"')[0]
        yield address, workers
    finally:
        for process in (*workers, scheduler):
            process.kill()
            process.wait()


def test_failed_job_runs_again_next_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A job that fails with an unexpected error is reported; the other rows are kept."""
    monkeypatch.setattr(runner, "_local_cluster", threads)
    good, *_, bad = expand_jobs(load_campaign(written(tmp_path)), tmp_path)
    with RowStore(tmp_path, "d") as store:
        reported: list[CampaignRow] = []
        jobs = [replace(bad, robot_json="no JSON"), good]
        with pytest.raises(ThumperError, match=f"1 of 2 .*{bad.key}.*run the same command again") as caught:
            runner.run_jobs(jobs, store, scheduler=None, workers=1, report=reported.append)
        assert "\n" not in str(caught.value)
        assert [r.key for r in store.rows] == [r.key for r in reported] == [good.key]
        runner.run_jobs([bad, good], store, scheduler=None, workers=1, report=reported.append)
        assert [r.key for r in store.rows] == [good.key, bad.key]


def test_ctrl_c_during_cluster_start_is_not_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    """The worker processes do not receive the signal; each would print a traceback."""
    blocked: list[int] = []

    def interrupted_start(**options: object) -> LocalCluster:
        os.kill(os.getpid(), signal.SIGINT)
        cluster = LocalCluster(**options)  # type: ignore[no-untyped-call]
        status = Path(f"/proc/{cluster.workers[0].pid}/status").read_text()
        blocked.append(int(status.partition("SigBlk:")[2].split()[0], 16))
        return cluster

    monkeypatch.setattr("distributed.LocalCluster", interrupted_start)
    with pytest.raises(KeyboardInterrupt), runner._local_cluster(1):
        pytest.fail("the interrupt was lost")
    assert blocked[0] & 1 << signal.SIGINT - 1


@contextmanager
def threads(workers: int | None) -> Iterator[LocalCluster]:
    """Start a cluster inside this process, which is faster than one of processes."""
    with LocalCluster(  # type: ignore[no-untyped-call]
        n_workers=workers, threads_per_worker=1, processes=False, dashboard_address=None
    ) as cluster:
        yield cluster


def test_killed_worker_loses_no_row(
    tmp_path: Path, cluster: tuple[str, list[subprocess.Popen[bytes]]]
) -> None:
    address, workers = cluster
    path = written(tmp_path)
    out = tmp_path / "out"
    run = subprocess.Popen(
        [BIN / "thumper", "campaign", path, "--out", out, "--scheduler", address], stdout=subprocess.DEVNULL
    )
    rows = out / "rows.csv"
    while not rows.exists() or rows.read_text().count("\n") < 2:  # the header and a row
        assert run.poll() is None
        time.sleep(0.05)
    os.kill(workers[0].pid, signal.SIGKILL)
    assert run.wait(200) == 0
    keys = [line.split(",")[0] for line in rows.read_text().splitlines()[1:]]
    assert sorted(keys) == ["step/default/3", "step/default/4", "step/gentle/3", "step/gentle/4"]
    assert (out / "rows.parquet").read_bytes().startswith(b"PAR1")
    assert (out / "summary.png").read_bytes().startswith(b"\x89PNG")
