"""Planners of a batch compared: outcomes and metrics by category, differences with intervals, and what they prove."""

from interdrive.comparison.compare import compare
from interdrive.comparison.folder import save_comparison
from interdrive.comparison.metrics import METRICS, Metric
from interdrive.comparison.result import DIFFERENCE_COLUMNS, TABLE_COLUMNS, Comparison
from interdrive.comparison.variants import ComparedSet

__all__ = [
    "DIFFERENCE_COLUMNS",
    "METRICS",
    "TABLE_COLUMNS",
    "ComparedSet",
    "Comparison",
    "Metric",
    "compare",
    "save_comparison",
]
