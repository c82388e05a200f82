"""What V2X costs is measured with and without it."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).resolve().parents[2] / "benchmarks" / "cooperation.py"
if not SCRIPT.is_file():
    pytest.skip("benchmarks/ is part of the repository, not of the package", allow_module_level=True)


def test_every_number_of_agents_has_a_row_with_both_times_and_the_quartiles_of_their_ratio():
    command = [sys.executable, str(SCRIPT), "--agents", "2,3", "--steps", "2", "--repetitions", "1"]
    _, _, *rows = subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()
    cells = [[float(number) for number in re.findall(r"\d+(?:\.\d+)?", row)] for row in rows]
    assert [row[0] for row in cells] == [2, 3]
    assert all(len(row) == 6 and min(row[1:]) > 0 for row in cells)
    assert all(low <= ratio <= high for *_, ratio, low, high in cells)
