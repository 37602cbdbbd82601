"""Distribute a campaign's jobs over Dask workers and store each row when it arrives."""

import logging
import pickle
import signal
import uuid
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from multiprocessing import resource_tracker
from typing import TYPE_CHECKING, Any

from thumper.common.errors import EXIT_NOT_THERE, ThumperError
from thumper_hil.campaign.job import run_job
from thumper_hil.campaign.result_row import CampaignRow
from thumper_hil.campaign.result_table import RowStore
from thumper_hil.campaign.spec import CampaignJob

if TYPE_CHECKING:
    from distributed import Client, Future, LocalCluster

CONNECT_S = 10
NO_PAGES: dict[str, list[str]] = {
    "distributed.scheduler.http.routes": [],
    "distributed.worker.http.routes": [],
}


def run_jobs(
    jobs: list[CampaignJob],
    store: RowStore,
    *,
    scheduler: str | None,
    workers: int | None,
    report: Callable[[CampaignRow], None],
) -> None:
    """Run the jobs that the store does not contain, on a local cluster or on the one at `scheduler`.

    Raises
    ------
    ThumperError
        The scheduler does not answer or has stopped, or some drives could not run on their worker. The rows
        of all other drives are kept.
    """
    from distributed import CancelledError, Client, as_completed

    done = {row.key for row in store.rows}
    waiting = [job for job in jobs if job.key not in done]
    if not waiting:
        return
    with ExitStack() as stack:
        address = scheduler or stack.enter_context(_local_cluster(workers))
        try:
            client = stack.enter_context(Client(address, timeout=CONNECT_S))  # type: ignore[no-untyped-call]
        except (OSError, ValueError) as error:
            raise ThumperError(
                f"{scheduler}: no Dask scheduler responds; start one with `dask scheduler`",
                exit_code=EXIT_NOT_THERE,
            ) from error
        run = uuid.uuid4().hex  # for Dask, equal keys mean the same task, even across campaigns
        keys = {f"{job.key}-{run}": job.key for job in waiting}
        if scheduler:
            futures = _map_shipped(client, waiting, list(keys))
        else:
            futures = client.map(run_job, waiting, key=list(keys), pure=False)
        failures: list[str] = []
        for future in as_completed(futures):  # type: ignore[no-untyped-call]
            try:
                result = future.result()
                row = pickle.loads(result) if scheduler else result
            except CancelledError as error:
                raise ThumperError(
                    "the Dask scheduler has stopped; all finished drives are kept. To continue, run the same "
                    "command again",
                    exit_code=EXIT_NOT_THERE,
                ) from error
            except Exception as error:  # only this drive failed
                failures.append(f"{keys[future.key]}: {_describe(error)}")
            else:
                store.add(row)
                report(row)
            future.release()
    if failures:
        raise ThumperError(
            f"{len(failures)} of {len(jobs)} drives could not run. The first: {failures[0]}. "
            "All others are kept; fix the cause and run the same command again"
        )


def _map_shipped(client: "Client", jobs: list[CampaignJob], keys: list[str]) -> "list[Future[Any]]":
    """Start jobs on workers of somebody else, which get this Thumper first. Raises ThumperError."""
    from thumper_hil.campaign.shipping import ShippedPackage, pack, shipped_job

    try:
        client.register_plugin(ShippedPackage(pack()))
    except RuntimeError as error:
        raise ThumperError(str(error), exit_code=EXIT_NOT_THERE) from None
    packed = [pickle.dumps(job) for job in jobs]
    return list(client.map(shipped_job(), packed, key=keys, pure=False))


def _describe(error: Exception) -> str:
    """Return the error in one line. Dask retries a job whose worker dies a few times, then fails it."""
    from distributed.scheduler import KilledWorker

    if isinstance(error, KilledWorker):
        return f"{error.allowed_failures + 1} workers died while running it; check the free memory"
    if isinstance(error, ThumperError):
        return str(error)
    return f"{type(error).__name__}: {' '.join(str(error).split())}"


@contextmanager
def _local_cluster(workers: int | None) -> "Iterator[LocalCluster]":
    """Start local worker processes with SIGINT blocked; this process handles Ctrl-C and stops them.

    Scheduler and workers speak TLS with keys of their own, made for this campaign: Dask runs any code that it
    receives, and other users of this computer can connect to its ports. There is no web dashboard.

    The workers inherit the blocked signal from the thread that starts them, which inherits it from here. A
    Ctrl-C during the start takes effect once they run, because Dask cannot stop half-started workers cleanly.
    """
    import dask
    from distributed import LocalCluster

    interrupts: list[int] = []
    handler = signal.signal(signal.SIGINT, lambda number, _: interrupts.append(number))
    resource_tracker.ensure_running()  # multiprocessing would unblock the signal if it started this later
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        with dask.config.set(NO_PAGES):
            cluster = LocalCluster(  # type: ignore[no-untyped-call]
                n_workers=workers,
                threads_per_worker=1,
                processes=True,
                security=True,
                protocol="tls",
                dashboard_address="127.0.0.1:0",  # None would open port 8787
                scheduler_kwargs={"dashboard": False},
                silence_logs=logging.CRITICAL,  # errors are in the futures; the rest is noise after Ctrl-C
            )
    finally:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
        signal.signal(signal.SIGINT, handler)
    try:
        if interrupts:
            raise KeyboardInterrupt
        yield cluster
    finally:
        with suppress(TimeoutError):  # on a busy computer a killed worker takes long to exit
            cluster.close()
