"""The notebook among the examples runs, and its cells show what they promise."""

from pathlib import Path

import nbformat
from nbclient import NotebookClient

FILE = Path(__file__).parents[2] / "examples" / "06_notebook.ipynb"


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
    assert "8 goal_reached" in run["text/plain"]
    assert "<table" in run["text/html"]
    assert "outcome" in outcomes["text/html"]
    assert velocity["image/png"]
    assert "of 8 agents drive" in straight["text/html"] + straight["text/plain"]
    assert "<td>2001</td>" in straight["text/html"]
    assert report["text/html"].startswith("<iframe")
    assert "interrupted" in part["text/plain"]
    assert batch["text/plain"].startswith("planner __main__:Straight: it is defined in a notebook or script")
