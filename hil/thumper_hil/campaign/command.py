"""`thumper campaign`. Heavy imports are deferred until the command runs."""

from pathlib import Path
from typing import Annotated

import typer


def campaign(
    file: Annotated[Path, typer.Argument(help="Campaign file (TOML): missions, seeds, parameter sets.")],
    out: Annotated[Path, typer.Option(help="Folder for rows.csv and the summary.")] = Path("out/campaign"),
    scheduler: Annotated[
        str, typer.Option(help="Address of a running Dask scheduler (default: run on this computer).")
    ] = "",
    workers: Annotated[
        int, typer.Option(help="Number of local worker processes (0: one per core).", min=0, max=256)
    ] = 0,
) -> None:
    """Drive every mission with every seed and parameter set in simulation; write one row per drive.

    An interrupted campaign continues where it stopped. The exit status is 1 if a drive failed or had a
    contact.

    Example: `thumper campaign campaigns/robustness.toml --out out/robustness`
    """
    from importlib.util import find_spec

    from thumper.common.optional_packages import require_extra
    from thumper_hil.campaign.spec import campaign_digest, expand_jobs, load_campaign

    plan = load_campaign(file)  # a wrong file is refused before the slow imports
    jobs = expand_jobs(plan, file.parent)
    require_extra("campaign")
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    from thumper.cli.output.folder import prepare_output
    from thumper.common.errors import EXIT_INTERRUPTED, ThumperError
    from thumper.common.files import write_text
    from thumper_hil.campaign.figures import draw
    from thumper_hil.campaign.parquet import write_parquet
    from thumper_hil.campaign.result_row import CampaignRow, succeeded
    from thumper_hil.campaign.result_table import RowStore
    from thumper_hil.campaign.runner import run_jobs
    from thumper_hil.campaign.summary import markdown, summarise

    console = Console()
    prepare_output(out)
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with RowStore(out, campaign_digest(jobs)) as store, Progress(*columns, console=console) as progress:
        keys = {job.key for job in jobs}
        task = progress.add_task("drives", total=len(jobs), completed=sum(r.key in keys for r in store.rows))

        def report(row: CampaignRow) -> None:
            progress.advance(task)
            if not succeeded(row):
                progress.console.print(f"{row.key}: {row.reason}, {row.contacts} contacts", highlight=False)

        try:
            run_jobs(jobs, store, scheduler=scheduler or None, workers=workers or None, report=report)
        except KeyboardInterrupt:
            raise ThumperError(
                "interrupted; all finished drives are kept. To continue, run the same command again",
                exit_code=EXIT_INTERRUPTED,
            ) from None
        rows = sorted((row for row in store.rows if row.key in keys), key=lambda row: row.key)
    files = ["rows.csv", "summary.md", "summary.png"]
    if find_spec("pyarrow") is not None:
        files.append(write_parquet(out / "rows.parquet", rows).name)
    summaries = summarise(rows, plan.show)
    table = markdown(summaries, {one.name: one.preset for one in plan.parameters})
    write_text(out / "summary.md", table)
    draw(out / "summary.png", rows, summaries)
    console.print(table, highlight=False, markup=False, soft_wrap=True)
    console.print(f"in {out}/: {', '.join(files)}", highlight=False)
    if not all(map(succeeded, rows)):
        raise typer.Exit(1)
