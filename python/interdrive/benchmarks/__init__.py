"""Planners compared by one number on versioned sets of scenarios.

found = interdrive.benchmark("mypackage.mymodule:Mine", set="public-1", split="dev", scenarios="scenarios/")
print(found.score, found.low, found.high)

Sets, runs and what the number does not tell: docs/how_to/benchmark.md.
"""

from interdrive.benchmarks.panels import StoredPanel, store_panel
from interdrive.benchmarks.rows import Row
from interdrive.benchmarks.run import Benchmark, benchmark, read_benchmark
from interdrive.benchmarks.sets import SPLITS, BenchmarkSet, SetFile, read_set, set_names

__all__ = [
    "SPLITS",
    "Benchmark",
    "BenchmarkSet",
    "Row",
    "SetFile",
    "StoredPanel",
    "benchmark",
    "read_benchmark",
    "read_set",
    "set_names",
    "store_panel",
]
