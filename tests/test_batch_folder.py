"""The folder of a batch: what reaches the disk, who may do what at once, what it costs. Its runs are not driven."""

import hashlib
import os
from dataclasses import replace
from pathlib import Path

import pytest

from interdrive.batches import BatchFolder
from interdrive.batches.execute import failed
from interdrive.batches.runs import planned
from interdrive.run_settings import SimulationSettings


@pytest.fixture(scope="module")
def specs():
    """Runs with keys of their own."""
    choices = {"planner": "idm", "predictor": "lane_following", "agents": "all", "traffic": None, "alone": False}
    (spec,) = planned(["t_junction"], **choices, seeds=1, settings=SimulationSettings()).specs
    return [replace(spec, key=hashlib.sha256(str(i).encode()).hexdigest()[:32]) for i in range(300)]


@pytest.fixture
def folder(tmp_path):
    return BatchFolder.create(tmp_path / "out")


def store(folder, spec, status="crashed", error="why"):
    folder.store(spec.key, failed(spec, status, error, 1))


def test_merged_runs_have_reached_the_disk_before_their_own_files_go(folder, specs, monkeypatch):
    def fsync(handle):
        real_fsync(handle)
        found = os.fstat(handle)
        on_disk.add((found.st_ino, found.st_size))

    def unlink(path, **options):
        if path.parent.name == "runs" and path.suffix == ".parquet":
            merged = folder.results.stat()
            assert (merged.st_ino, merged.st_size) in on_disk
            removed.append(path.stem)
        real_unlink(path, **options)

    on_disk, removed = set(), []
    real_fsync, real_unlink = os.fsync, Path.unlink
    monkeypatch.setattr(os, "fsync", fsync)
    monkeypatch.setattr(Path, "unlink", unlink)
    for spec in specs[:2]:
        store(folder, spec)
    folder.tidy(now=True)
    assert sorted(removed) == sorted(spec.key for spec in specs[:2])
