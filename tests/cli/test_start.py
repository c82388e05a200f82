"""How little is loaded before the first answer: modules by name, and times as ratios to one that is always loaded."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import commonroad_documents as cr
import pytest

#: What only some commands need, or only their end.
HEAVY = frozenset(
    ("commonroad", "lxml", "matplotlib", "networkx", "omegaconf", "pandas", "PIL", "pyarrow", "scipy", "shapely")
)
#: Parts of the standard library that take longer to load than the command line.
SLOW = frozenset(("html.entities", "http.client", "importlib.metadata", "ssl", "urllib.request", "webbrowser"))

#: Ends a run after its first step and tells what was loaded until then.
TO_FIRST_STEP = """
import sys
from interdrive.simulation import Simulation
step = Simulation.step
def first(self):
    step(self)
    print(*sys.modules)
    sys.stdout.flush()
    __import__("os")._exit(0)
Simulation.step = first
sys.argv = ["interdrive", *sys.argv[1:]]
from interdrive.__main__ import start
start()
"""

#: Runs a command and tells what was loaded by it.
TO_THE_END = """
import sys, os
sys.argv = ["interdrive", *sys.argv[1:]]
from interdrive.__main__ import start
try:
    start()
except SystemExit as end:
    print()
    print(*sys.modules)
    sys.stdout.flush()
    os._exit(end.code or 0)
"""


def loaded(code: str, *arguments: str) -> set[str]:
    words = [sys.executable, "-c", code, *arguments]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    return set(done.stdout.splitlines()[-1].split())


def packages(modules: set[str]) -> set[str]:
    return {name.partition(".")[0] for name in modules}


def test_importing_the_package_loads_nothing_else():
    found = loaded("import sys; before = set(sys.modules); import interdrive; print(*set(sys.modules) - before)")
    assert {name for name in found if not name.startswith("interdrive")} <= {"__future__", "warnings", "importlib"}
    assert found & {"interdrive._core", "numpy"} == set()


def test_the_help_loads_the_command_line_alone():
    code = "import sys; sys.argv = ['interdrive', '--help']\ntry:\n    __import__('interdrive.cli').cli.main()\n"
    found = loaded(code + "except SystemExit:\n    print(*sys.modules)")
    assert "click" in found
    assert packages(found) & (HEAVY | {"numpy", "rich"}) == set()
    assert found & SLOW == set()
    own = {name for name in found if name.startswith("interdrive.")}
    assert own == {"interdrive.cli", "interdrive.cli.terminal", "interdrive.errors"}


def test_nothing_is_loaded_before_the_first_step_that_only_the_end_needs(tmp_path):
    states = [cr.state(k, 5.0 + k, 0.0, orientation=0.0, velocity=10.0) for k in range(1, 30)]
    path = cr.saved(tmp_path, cr.document(cr.car(71, cr.initial(5.0), states)), "some.xml")
    found = loaded(TO_FIRST_STEP, "run", str(path), "--quiet", "--out", str(tmp_path / "made"))
    assert "numpy" in found
    assert packages(found) & HEAVY == set()
    assert found & SLOW == set()
    assert not any(name.startswith("interdrive.plots") for name in found)


@pytest.mark.long
def test_no_command_that_writes_or_reads_tables_loads_pandas(tmp_path):
    """pyarrow imports it with most conversions, where it is installed: half a second."""
    pytest.importorskip("pandas")
    made = str(tmp_path / "made")
    for words in (
        ("run", "t_junction", "--agents", "2001", "--planner", "idm", "--out", made),
        ("explain", made, "2001"),
        ("score", made),
        ("criticality", made),
        ("verify", made),
        ("batch", "t_junction", "--planner", "idm,lawful", "--agents", "2", "--out", f"{made}_many"),
        ("compare", f"{made}_many"),
        ("report", made, "--out", f"{made}.html"),
    ):
        found = loaded(TO_THE_END, *words)
        assert "pyarrow.parquet" in found, words
        assert "pandas" not in found, words


@pytest.mark.parametrize(
    ("code", "most"),
    [("import interdrive", 0.5), ("import sys; sys.argv = ['interdrive', '--help']; import interdrive.cli", 1.0)],
    ids=["package", "command line"],
)
def test_what_comes_first_takes_less_time_than_loading_numpy(code, most):
    ratio = seconds(code) / seconds("import numpy")
    assert ratio < most


def seconds(code: str) -> float:
    """Computing time beyond that of an empty program [s], the least of a few: load makes it longer, never shorter."""
    timed = f"import time; t = time.process_time(); exec({code!r}); print(time.process_time() - t)"
    words = [sys.executable, "-c", timed]
    runs = [subprocess.run(words, capture_output=True, text=True, check=True, cwd=Path.cwd()) for _ in range(5)]
    return min(float(done.stdout) for done in runs)


@pytest.mark.parametrize(("given", "used"), [(None, "1"), ("3", "3")])
def test_numpy_shares_no_product_among_threads_unless_it_is_told_to(monkeypatch, given, used):
    """How OpenBLAS shares a product decides its last bits."""
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    if given is not None:
        monkeypatch.setenv("OPENBLAS_NUM_THREADS", given)
    code = TO_THE_END.replace("print(*sys.modules)", "print(os.environ['OPENBLAS_NUM_THREADS'])")
    assert loaded(code, "--help") == {used}
