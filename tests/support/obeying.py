"""The planner of the example that obeys the rules of the road, in the process of the run, which saves half a second."""

import importlib.util
from pathlib import Path

EXAMPLE = Path(__file__).parents[2] / "examples" / "08_obeying_planner.py"

_spec = importlib.util.spec_from_file_location("obeying_example", EXAMPLE)
assert _spec is not None
assert _spec.loader is not None
_example = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(_example)


class Obeys(_example.Obeys):
    """As in the example, but for processes."""

    parallel = False
