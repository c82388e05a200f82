"""Every example of the README runs."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

README = (Path(__file__).parent.parent / "README.md").read_text(encoding="utf-8")
PYTHON = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
COMMANDS = [line[2:] for block in re.findall(r"```console\n(.*?)```", README, re.DOTALL) for line in block.splitlines()]


def test_the_readme_has_examples():
    assert len(PYTHON) == 4
    assert len(COMMANDS) == 14


@pytest.mark.parametrize("number", range(len(PYTHON)))
def test_an_example_in_python_runs(number, tmp_path):
    command = [sys.executable, "-c", PYTHON[number]]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_the_commands_run_one_after_the_other(tmp_path):
    for command in COMMANDS:
        program, *arguments = shlex.split(command)
        assert program == "interdrive"
        words = [sys.executable, "-m", "interdrive", *arguments]
        done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, f"{command}: {done.stderr}"
    assert (tmp_path / "out" / "t_junction" / "outcomes.parquet").exists()
