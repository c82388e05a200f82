"""Modules of the benchmark of driving, and rows of its file."""

import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[2] / "benchmarks" / "driving"


@pytest.fixture
def part(monkeypatch):
    monkeypatch.syspath_prepend(str(FOLDER))

    def imported(name):
        return __import__(name)

    yield imported
    for path in FOLDER.glob("[a-z]*.py"):
        sys.modules.pop(path.stem, None)


@pytest.fixture
def row(part):
    """An agent that reaches its goal in time; what differs is named."""
    drives = part("drives")
    zeros = {"str": "", "int": 0, "float": 0.0, "bool": False}
    usual = {name: zeros[str(field.type)] for name, field in drives.Drive.__dataclass_fields__.items()}
    nothing = dict.fromkeys(("partner_id", "head_id", "event"), -1)
    usual |= nothing | {"reachable": True, "outcome": "goal_reached", "late": float("nan"), "origin": "recorded"}

    def made(agent_id, **changed):
        return drives.Drive(**usual | {"agent_id": agent_id} | changed)

    return made
