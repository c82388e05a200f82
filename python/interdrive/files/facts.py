"""What a file states beside its elements."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Facts:
    """Contents of a file that objects of commonroad-io do not have.

    Attributes:
        benchmark_id: As written; empty: that of the scenario, which commonroad-io rewrites where it cannot parse it.
        version: Version of the format; empty if unknown.
        dangling: One line per reference to an element that does not exist; None: to be found in the network.
        notes: What the file lacks, in words.
    """

    benchmark_id: str = ""
    version: str = ""
    dangling: tuple[str, ...] | None = None
    notes: tuple[str, ...] = ()
