"""Campaign jobs: drives in this process and on workers of which one dies."""

import os
import shutil
import signal
import subprocess
import sys
import sysconfig
import time
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from importlib.util import find_spec
from io import BytesIO
from pathlib import Path
from types import SimpleNamespace

import pytest
from benchmarks.shared.live import END_WITH_PARENT
from distributed import Client, LocalCluster, Security

from tests.hil.campaign.samples import FILE, written
from thumper.common.errors import ThumperError
from thumper_hil.bench import simulation
from thumper_hil.campaign import runner
from thumper_hil.campaign.job import run_job
from thumper_hil.campaign.result_row import CampaignRow
from thumper_hil.campaign.result_table import RowStore
from thumper_hil.campaign.shipping import ShippedPackage
from thumper_hil.campaign.spec import expand_jobs, load_campaign
from thumper_hil.campaign.summary import markdown, summarise
from thumper_hil.world.world_file import WORLDS

BIN = Path(sys.executable).parent
ROOT = Path(__file__).parents[3]
PERSON = """
[[person]]
waypoints_m = [[1.9, 0.0], [1.1, 0.0]]
speed_m_s = 1.0
leg_radius_m = 0.06
"""


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


def test_documented_example_runs(tmp_path: Path) -> None:
    """The documented example runs with the files from `campaigns/` that it names."""
    page = (ROOT / "docs" / "howto" / "campaign.md").read_text()
    (tmp_path / "example.toml").write_text(page.split("```toml\n")[1].split("```")[0])
    for name in ("rbpf.toml", "slip.toml"):
        shutil.copy(ROOT / "campaigns" / name, tmp_path)
    jobs = expand_jobs(load_campaign(tmp_path / "example.toml"), tmp_path)
    result = run_job(jobs[0])
    assert result.reached, result.reason


def test_a_person_who_walks_into_the_robot_is_a_touch_by_people(tmp_path: Path) -> None:
    """The person comes from behind and turns back at the robot."""
    (tmp_path / "room.toml").write_text(f'base = "{WORLDS / "lab"}"\n{PERSON}')
    jobs = expand_jobs(load_campaign(written(tmp_path, FILE.replace('"lab"', '"room.toml"'))), tmp_path)
    result = run_job(jobs[0])
    assert (result.contacts, result.reached) == (0, True), result.reason
    assert result.touches_by_people > 0


@pytest.mark.slow
def test_tour_with_a_fault_reaches_its_goal(tmp_path: Path) -> None:
    """The robot drives from x = 1 via 1.3 to 0.6 while the wheels of one side slip."""
    (tmp_path / "slip.toml").write_text("faults = [{ at_s = 0.5, slip.left = 0.7 }]")
    plain = 'parameters = [{ name = "default" }, { name = "gentle", robot = "gentle.toml" }]'
    slips = 'parameters = [{ name = "intact" }, { name = "slips", scenario = "slip.toml" }]'
    text = FILE.replace(plain, slips).replace("via = [[0.8, 0.0]]", "via = [[1.3, 0.0]]")
    jobs = expand_jobs(load_campaign(written(tmp_path, text)), tmp_path)
    intact, slipping = (run_job(job) for job in jobs[:2])
    assert intact.reached, intact.reason
    with pytest.raises(ThumperError, match="no simulation"):
        simulation(jobs[0].key.replace("/", "~"))  # its memory is released
    assert slipping.reached, slipping.reason
    assert 0.8 < intact.path_length_m < 2.0
    assert slipping.odometry_error_m > 1.5 * intact.odometry_error_m
    (summary,) = summarise([slipping], ["path_length_m", "pose_max_m"])
    assert list(summary.means) == ["path_length_m", "pose_max_m"]
    assert "| path length [m] | SLAM pose error, worst [m] |" in markdown([summary], {"slips": "nominal"})


def strangers_python(folder: Path) -> Path:
    """Return a Python with the packages of this one, but without Thumper."""
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", folder / "venv"], check=True)
    (site,) = (folder / "venv").glob("lib/python*/site-packages")
    (site / "packages.pth").write_text(sysconfig.get_path("purelib"))  # no .pth file in there counts
    return folder / "venv/bin/python"


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """Start a scheduler and two workers, each in its own process, in an environment without Thumper."""
    file = tmp_path / "scheduler.json"
    dask: list[str | Path] = [strangers_python(tmp_path), "-m", "dask"]
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    scheduler = subprocess.Popen(
        [
            *END_WITH_PARENT,
            *dask,
            "scheduler",
            "--port",
            "0",
            "--no-dashboard",
            "--scheduler-file",
            file,
        ],
        stderr=subprocess.DEVNULL,
        env=environment,
    )
    workers: list[subprocess.Popen[bytes]] = []
    try:
        while not file.exists() or '"address"' not in file.read_text():
            assert scheduler.poll() is None
            time.sleep(0.1)
        command: list[str | Path] = [
            *dask,
            "worker",
            "--scheduler-file",
            file,
            "--nthreads",
            "1",
            "--no-dashboard",
            "--no-nanny",  # a nanny would restart a killed worker
        ]
        workers += [
            subprocess.Popen(
                [*END_WITH_PARENT, *command], stderr=subprocess.DEVNULL, cwd=tmp_path, env=environment
            )
            for _ in range(2)
        ]
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


def test_only_the_campaign_itself_reaches_its_scheduler() -> None:
    with runner._local_cluster(1) as cluster:
        with Client(cluster, timeout=20) as client:  # type: ignore[no-untyped-call]
            assert client.submit(sum, [1, 2]).result() == 3
        address = cluster.scheduler_address
        assert address.startswith("tls://127.0.0.1:")
        stranger = Security.temporary()  # type: ignore[no-untyped-call]  # keys of another authority
        for other, security in ((address.replace("tls:", "tcp:"), None), (address, stranger)):
            with pytest.raises(OSError, match=r"Timed out|closed|connect|certificate does not match"):
                Client(other, timeout=3, security=security)  # type: ignore[no-untyped-call]


@pytest.mark.slow
def test_whole_campaign_runs_over_tls(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two parameter sets on two worker processes; rows and progress come back encrypted."""
    start, addresses = runner._local_cluster, list[str]()

    @contextmanager
    def watched(workers: int | None) -> Iterator[LocalCluster]:
        with start(workers) as cluster:
            addresses.extend((cluster.scheduler_address, *cluster.scheduler_info["workers"]))
            yield cluster

    monkeypatch.setattr(runner, "_local_cluster", watched)
    jobs = expand_jobs(load_campaign(written(tmp_path)), tmp_path)[1:3]
    with RowStore(tmp_path, "d") as store:
        reported: list[CampaignRow] = []
        runner.run_jobs(jobs, store, scheduler=None, workers=2, report=reported.append)
        assert {row.key for row in store.rows} == {row.key for row in reported} == {job.key for job in jobs}
        assert all(row.reached for row in store.rows)
    assert len(addresses) == 3
    assert all(address.startswith("tls://127.0.0.1:") for address in addresses)


@contextmanager
def threads(workers: int | None) -> Iterator[LocalCluster]:
    """Start a cluster inside this process, which is faster than one of processes."""
    with LocalCluster(  # type: ignore[no-untyped-call]
        n_workers=workers, threads_per_worker=1, processes=False, dashboard_address=None
    ) as cluster:
        yield cluster


def test_worker_without_a_requirement_names_it(tmp_path: Path) -> None:
    archive = BytesIO()
    with zipfile.ZipFile(archive, "w") as stream:
        needs = ["numpy>=2.0", "no-such-package<2,>=1", "nor-this; extra == 'ui'"]
        lines = "".join(f"Requires-Dist: {one}\n" for one in needs)
        stream.writestr("t.dist-info/METADATA", f"Name: t\nVersion: 1\n{lines}")
    before = list(sys.path)
    worker = SimpleNamespace(local_directory=tmp_path, name="tcp://w")
    with pytest.raises(RuntimeError, match="worker tcp://w lacks no-such-package; install"):
        ShippedPackage(archive.getvalue()).setup(worker)
    assert sys.path == before


@pytest.mark.slow
def test_campaign_brings_thumper_to_workers_and_loses_no_row_with_one(
    tmp_path: Path, cluster: tuple[str, list[subprocess.Popen[bytes]]]
) -> None:
    """Neither scheduler nor workers have Thumper; one worker is killed."""
    address, workers = cluster
    with Client(address, timeout=20) as client:  # type: ignore[no-untyped-call]
        client.wait_for_workers(2, timeout=60)
        for where in (
            client.run(find_spec, "thumper").values(),
            [client.run_on_scheduler(find_spec, "thumper")],
        ):
            assert set(where) == {None}
    path = written(tmp_path)
    out = tmp_path / "out"
    run = subprocess.Popen(
        [*END_WITH_PARENT, BIN / "thumper", "campaign", path, "--out", out, "--scheduler", address],
        stdout=subprocess.DEVNULL,
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
