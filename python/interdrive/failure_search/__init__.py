"""Searches small disturbances under which a planner fails by its own fault although another driver would not.

found = interdrive.search("scenarios", planner="mypackage.mine:Mine", runs=1000, out="out/search")
found.failures[0].words

Definitions and limits: docs/how_to/search.md.
"""

from interdrive.failure_search.allocation import METHODS, SOURCES
from interdrive.failure_search.failures import Failure, Verdict, check_failure, failures, replay
from interdrive.failure_search.rates import Yield
from interdrive.failure_search.search import Found, search
from interdrive.failure_search.search_folder import EVALUATION_COLUMNS, is_search
from interdrive.failure_search.spaces import ERRORS, Space
from interdrive.failure_search.summary import HEAD, Summary, compared

__all__ = [
    "ERRORS",
    "EVALUATION_COLUMNS",
    "HEAD",
    "METHODS",
    "SOURCES",
    "Failure",
    "Found",
    "Space",
    "Summary",
    "Verdict",
    "Yield",
    "check_failure",
    "compared",
    "failures",
    "is_search",
    "replay",
    "search",
]
