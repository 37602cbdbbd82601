"""Spread a campaign's jobs over Dask workers and keep each row as it comes."""

import logging
import signal
import uuid
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from multiprocessing import resource_tracker
from typing import TYPE_CHECKING

from thumper.common.errors import EXIT_NOT_THERE, ThumperError
from thumper_hil.campaign.job import run_job
from thumper_hil.campaign.result_row import CampaignRow
from thumper_hil.campaign.result_table import RowStore
from thumper_hil.campaign.spec import CampaignJob

if TYPE_CHECKING:
    from distributed import LocalCluster

CONNECT_S = 10


def run_jobs(
    jobs: list[CampaignJob],
    store: RowStore,
    *,
    scheduler: str | None,
    workers: int | None,
    show: Callable[[CampaignRow], None],
) -> None:
    """Run what the store does not hold yet, on a local cluster or on the one at `scheduler`.

    Raises
    ------
    ThumperError
        Nobody answers at `scheduler`, or not any more; or some drives could not be begun or ended: the
        machine's fault and not the robot's. The rows of all others are kept.
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
                f"{scheduler}: no Dask scheduler answers; start one with `dask scheduler`",
                exit_code=EXIT_NOT_THERE,
            ) from error
        run = uuid.uuid4().hex  # to Dask the same key is the same drive, also in somebody else's campaign
        keys = {f"{job.key}-{run}": job.key for job in waiting}
        futures = client.map(run_job, waiting, key=list(keys), pure=False)
        failures: list[str] = []
        for future in as_completed(futures):  # type: ignore[no-untyped-call]
            try:
                row = future.result()
            except CancelledError as error:
                raise ThumperError(
                    "the Dask scheduler is gone; the rows so far are kept: run the same command again",
                    exit_code=EXIT_NOT_THERE,
                ) from error
            except Exception as error:  # it ends this drive alone
                failures.append(f"{keys[future.key]}: {_said(error)}")
            else:
                store.add(row)
                show(row)
            future.release()
    if failures:
        raise ThumperError(
            f"{len(failures)} of {len(jobs)} drives could not be driven; the first, {failures[0]}. "
            "All others are kept: mend it and run the same command again"
        )


def _said(error: Exception) -> str:
    """One line. A job whose worker dies Dask gives to another, and gives up after some."""
    from distributed.scheduler import KilledWorker

    if isinstance(error, KilledWorker):
        return f"{error.allowed_failures + 1} workers died of it; is there enough memory?"
    if isinstance(error, ThumperError):
        return str(error)
    return f"{type(error).__name__}: {' '.join(str(error).split())}"


@contextmanager
def _local_cluster(workers: int | None) -> "Iterator[LocalCluster]":
    """Processes of this machine to which Ctrl-C does not come: this process has it, and ends them.

    They inherit that it is blocked from the thread that begins them, which inherits it from here. A Ctrl-C
    meanwhile counts once they are there: Dask does not end those well that are only half begun.
    """
    from distributed import LocalCluster

    came: list[int] = []
    heeded = signal.signal(signal.SIGINT, lambda number, _: came.append(number))
    resource_tracker.ensure_running()  # if multiprocessing begins it later, that lifts the block
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        cluster = LocalCluster(  # type: ignore[no-untyped-call]
            n_workers=workers,
            threads_per_worker=1,
            processes=True,
            dashboard_address=None,
            silence_logs=logging.CRITICAL,  # what went wrong is in the future; the rest is noise of Ctrl-C
        )
    finally:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
        signal.signal(signal.SIGINT, heeded)
    try:
        if came:
            raise KeyboardInterrupt
        yield cluster
    finally:
        with suppress(TimeoutError):  # on a busy machine a worker that was killed takes long to be gone
            cluster.close()
