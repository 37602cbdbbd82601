"""Spread a campaign's jobs over Dask workers and keep each row as it comes."""

from collections.abc import Callable
from contextlib import ExitStack

from thumper.errors import ThumperError
from thumper_hil.campaign.job import Row, run_job
from thumper_hil.campaign.rows import RowStore
from thumper_hil.campaign.spec import Job

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
    from distributed import CancelledError, Client, LocalCluster, as_completed
    from distributed.scheduler import KilledWorker

    done = {row.key for row in store.rows}
    waiting = [job for job in jobs if job.key not in done]
    if not waiting:
        return
    with ExitStack() as stack:
        address: str | LocalCluster
        if scheduler is None:
            cluster = LocalCluster(  # type: ignore[no-untyped-call]
                n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=None
            )
            address = stack.enter_context(cluster)
        else:
            address = scheduler
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
