"""Write the rows as Parquet, for example for pandas or Dask."""

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from thumper_hil.campaign.result_row import CampaignRow


def write_parquet(path: Path, rows: Sequence[CampaignRow]) -> Path:
    """Write all rows, with the column types of `CampaignRow`."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    pq.write_table(pa.Table.from_pylist([asdict(row) for row in rows]), path)
    return path
