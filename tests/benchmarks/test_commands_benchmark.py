"""What whole commands take."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[2] / "benchmarks"
if not FOLDER.is_dir():
    pytest.skip("benchmarks/ is part of the repository, not of the package", allow_module_level=True)


@pytest.fixture
def commands(monkeypatch):
    monkeypatch.syspath_prepend(str(FOLDER))
    return importlib.import_module("commands")


def test_every_command_writes_a_folder_that_is_not_there_yet(commands, monkeypatch):
    """A batch that finds its folder does only the runs that are missing there: none."""
    given, noted = [], {}

    def taken(command):
        given.append(command)
        return float(len(given)), 0.5

    monkeypatch.setattr(commands, "taken", taken)
    monkeypatch.setattr(commands, "note", noted.__setitem__)
    monkeypatch.setattr(sys, "argv", ["commands.py", "scenarios", "--repetitions", "2"])
    commands.main()
    folders = [command[command.index("--out") + 1] for command in given if "--out" in command]
    assert len(folders) == 2 * 3 + 2
    assert len(set(folders)) == len(folders)
    assert noted["development"] == len(given), "the first one fills caches of files"
    assert noted["run_highway"] == 0.5


def test_a_command_that_fails_is_not_measured(commands):
    with pytest.raises(SystemExit, match="nothing works"):
        commands.taken([sys.executable, "-c", "import sys; print('nothing works', file=sys.stderr); sys.exit(1)"])
