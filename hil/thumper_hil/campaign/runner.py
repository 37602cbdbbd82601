"""Spread a campaign's jobs over Dask workers and keep each row as it comes."""

import logging
import signal
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from typing import TYPE_CHECKING

from thumper.errors import ThumperError
from thumper_hil.campaign.job import Row, run_job
from thumper_hil.campaign.rows import RowStore
from thumper_hil.campaign.spec import Job

if TYPE_CHECKING:
    from distributed import LocalCluster

CONNECT_S = 10
RETRIES = 3  # a job whose worker dies is given to another


def run_jobs(
    jobs: list[Job],
    store: RowStore,
    *,
    scheduler: str | None,
    workers: int | None,
    show: Callable[[Row], None],
) -> None:
    """Run what the store does not hold yet, on a local cluster or on the one at `scheduler`.

    Raises
    ------
    ThumperError
        Nobody answers at `scheduler`, or not any more; a job's worker died again and again. The rows so far
        are kept.
    """
    from distributed import CancelledError, Client, as_completed
    from distributed.scheduler import KilledWorker

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
                f"{scheduler}: no Dask scheduler answers; start one with `dask scheduler`", exit_code=3
            ) from error
        keys = [f"{job.key}-thumper" for job in waiting]
        futures = client.map(run_job, waiting, key=keys, pure=False, retries=RETRIES)
        for future in as_completed(futures):  # type: ignore[no-untyped-call]
            try:
                row = future.result()
            except KilledWorker as error:
                raise ThumperError(
                    f"{future.key}: its workers died {RETRIES} times; is there enough memory? "
                    "The rows so far are kept: run the same command again"
                ) from error
            except CancelledError as error:
                raise ThumperError(
                    "the Dask scheduler is gone; the rows so far are kept: run the same command again",
                    exit_code=3,
                ) from error
            store.add(row)
            show(row)
            future.release()


@contextmanager
def _local_cluster(workers: int | None) -> "Iterator[LocalCluster]":
    """Processes of this machine, which inherit that Ctrl-C is ignored: this process has it, and ends them."""
    from distributed import LocalCluster

    heeded = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        cluster = LocalCluster(  # type: ignore[no-untyped-call]
            n_workers=workers,
            threads_per_worker=1,
            processes=True,
            dashboard_address=None,
            silence_logs=logging.ERROR,  # a drive that Ctrl-C ends is a warning
        )
    finally:
        signal.signal(signal.SIGINT, heeded)
    try:
        yield cluster
    finally:
        with suppress(TimeoutError):  # on a busy machine a worker that was killed takes long to be gone
            cluster.close()
