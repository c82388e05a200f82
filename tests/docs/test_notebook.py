"""The notebook among the examples runs, and its cells show what they promise."""

from pathlib import Path

import nbformat
import pytest
from jupyter_client.manager import start_new_kernel
from nbclient import NotebookClient

pytestmark = pytest.mark.long

FILE = Path(__file__).parents[2] / "examples" / "07_notebook.ipynb"


def shown(cell):
    """What a cell shows: text by type, printed lines as text/plain."""
    found = {}
    for output in cell.outputs:
        for kind, value in output.get("data", {"text/plain": output.get("text", "")}).items():
            found[kind] = found.get(kind, "") + value
    return found


def test_the_notebook_runs_and_its_cells_show_tables_figures_progress_and_the_report(tmp_path):
    notebook = nbformat.read(FILE, as_version=4)
    assert not any(cell.get("outputs") for cell in notebook.cells)
    NotebookClient(notebook, timeout=120, resources={"metadata": {"path": str(tmp_path)}}).execute()
    run, outcomes, velocity, straight, report, part, batch = (
        shown(cell) for cell in notebook.cells if cell.cell_type == "code"
    )
    assert "7 goal_reached" in run["text/plain"]
    assert "<table" in run["text/html"]
    assert "outcome" in outcomes["text/html"]
    assert velocity["image/png"]
    assert "of 8 agents drive" in straight["text/html"] + straight["text/plain"]
    assert "<td>2001</td>" in straight["text/html"]
    assert report["text/html"].startswith("<iframe")
    assert "interrupted" in part["text/plain"]
    assert batch["text/plain"].startswith("planner __main__:Straight: it is defined in a notebook or script")


LONG = """
import time
import interdrive as idr

def on_step(step, *_):
    print("step", step, flush=True)
    time.sleep(0.1)

try:
    idr.simulate("t_junction", agents=1, predictor="constant_velocity", on_step=on_step)
except idr.RunInterrupted as stopped:
    print("kept", stopped.run.finished, stopped.run.states.n_steps)
print("the kernel lives")
"""


def test_the_stop_button_of_a_notebook_keeps_the_run_so_far(tmp_path):
    manager, client = start_new_kernel(cwd=str(tmp_path))
    try:
        client.execute(LONG)
        printed = ""
        while "the kernel lives" not in printed:
            message = client.get_iopub_msg(timeout=60)
            assert message["msg_type"] != "error", message["content"]
            before, printed = printed, printed + message["content"].get("text", "")
            if "step 3" in printed and "step 3" not in before:
                manager.interrupt_kernel()
    finally:
        client.stop_channels()
        manager.shutdown_kernel(now=True)
    _, finished, n_steps = next(line for line in printed.splitlines() if line.startswith("kept")).split()
    assert finished == "False"
    assert 4 <= int(n_steps) < 60
