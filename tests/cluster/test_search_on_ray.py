"""A search for failures on a Ray cluster finds what it finds without it, to the bit."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

from interdrive.failure_search import Summary

SUPPORT = Path(__file__).parents[1] / "support"


def searched(folder, out, *more):
    # Nodes have the planner where this process has it; a blind one fails at once.
    words = ["t_junction", "--planner", "drivers:Straight", "--agent", 1006, "--runs", 2, "--out", out, *more]
    done = subprocess.run(
        [sys.executable, "-m", "interdrive", "search", *map(str, words)],
        cwd=folder, capture_output=True, text=True, check=False, env={**os.environ, "PYTHONPATH": ""},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr


def test_a_search_on_a_cluster_finds_the_same(cluster, tmp_path):
    shutil.copy(SUPPORT / "drivers.py", tmp_path / "drivers.py")
    searched(tmp_path, "here", "--workers", 1)
    searched(tmp_path, "there", "--ray", cluster.address)
    for name in ("evaluations.jsonl", "evaluations.parquet", "search.json"):
        assert (tmp_path / "there" / name).read_bytes() == (tmp_path / "here" / name).read_bytes(), name
    digests = [[one.digest for one in Summary.of(tmp_path / name).failures] for name in ("here", "there")]
    assert digests[0] == digests[1] != []
