"""How much Python does: calls of functions, which are the same on a slow and a fast machine."""

import cProfile
import pstats
from collections.abc import Callable


def calls_in(work: Callable[[], object]) -> int:
    """Calls of functions, written in Python or built in, while `work` runs."""
    profile = cProfile.Profile()
    profile.runcall(work)
    return pstats.Stats(profile).total_calls
