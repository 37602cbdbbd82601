"""Write the rows as Parquet, for example for pandas or Dask."""

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from thumper.common.files import write_whole
from thumper_hil.campaign.result_row import CampaignRow


def write_parquet(path: Path, rows: Sequence[CampaignRow]) -> Path:
    """Write all rows, with the column types of `CampaignRow`."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    with write_whole(path) as stream:
        pq.write_table(pa.Table.from_pylist([asdict(row) for row in rows]), stream)
    return path
