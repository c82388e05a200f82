"""Many runs: scenarios by planners by seeds, on all cores or a Ray cluster, into one Parquet data set."""

from interdrive.batches.columns import COLUMNS, NOT_ARRIVED, STATUS
from interdrive.batches.compare import DIFFERENCE_COLUMNS, TABLE_COLUMNS, Comparison, compare, save_comparison
from interdrive.batches.conduct import BatchSummary, Progress, batch
from interdrive.batches.execute import KEEP
from interdrive.batches.folder import BatchFolder, read_batch
from interdrive.batches.metrics import METRICS, Metric
from interdrive.batches.query import Answer, query
from interdrive.batches.runs import TRAFFIC, labels_of
from interdrive.batches.variants import ComparedSet

__all__ = [
    "COLUMNS",
    "DIFFERENCE_COLUMNS",
    "KEEP",
    "METRICS",
    "NOT_ARRIVED",
    "STATUS",
    "TABLE_COLUMNS",
    "TRAFFIC",
    "Answer",
    "BatchFolder",
    "BatchSummary",
    "ComparedSet",
    "Comparison",
    "Metric",
    "Progress",
    "batch",
    "compare",
    "labels_of",
    "query",
    "read_batch",
    "save_comparison",
]
