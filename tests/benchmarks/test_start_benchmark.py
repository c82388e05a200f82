"""Stages from the command to the first step."""

from __future__ import annotations

import importlib
from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[2] / "benchmarks"
if not FOLDER.is_dir():
    pytest.skip("benchmarks/ is part of the repository, not of the package", allow_module_level=True)


def test_every_stage_between_the_command_and_the_first_step_takes_time(monkeypatch):
    monkeypatch.syspath_prepend(str(FOLDER))
    start = importlib.import_module("start")

    seconds = start.stages("t_junction")

    assert len(seconds) == len(start.STAGES)
    assert min(seconds) > 0.0
