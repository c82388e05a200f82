"""Many runs: scenarios by planners by seeds, on all cores or a Ray cluster, into one Parquet data set."""

from interdrive.batches.columns import COLUMNS, NOT_ARRIVED, STATUS
from interdrive.batches.job import KEEP
from interdrive.batches.plan import TRAFFIC, labels_of
from interdrive.batches.query import Answer, query
from interdrive.batches.run import BatchSummary, Progress, batch
from interdrive.batches.store import BatchFolder, read_batch

__all__ = [
    "COLUMNS",
    "KEEP",
    "NOT_ARRIVED",
    "STATUS",
    "TRAFFIC",
    "Answer",
    "BatchFolder",
    "BatchSummary",
    "Progress",
    "batch",
    "labels_of",
    "query",
    "read_batch",
]
