"""Many runs: scenarios by planners by seeds, on all cores or a Ray cluster, into one Parquet data set."""

from interdrive.batches.columns import COLUMNS, NOT_ARRIVED, STATUS
from interdrive.batches.conduct import BatchSummary, Progress, batch
from interdrive.batches.execute import KEEP
from interdrive.batches.folder import BatchFolder, read_batch
from interdrive.batches.runs import TRAFFIC

__all__ = [
    "COLUMNS",
    "KEEP",
    "NOT_ARRIVED",
    "STATUS",
    "TRAFFIC",
    "BatchFolder",
    "BatchSummary",
    "Progress",
    "batch",
    "read_batch",
]
