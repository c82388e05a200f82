"""The folder of a batch: what reaches the disk, who may do what at once, what it costs. Its runs are not driven."""

import hashlib
import os
from dataclasses import replace
from pathlib import Path

import pytest

from interdrive.batches import BatchFolder, query
from interdrive.batches.execute import failed
from interdrive.batches.runs import planned
from interdrive.errors import InputError
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


@pytest.mark.parametrize(
    ("question", "line"),
    [
        ("copy (select 1 as a) to '{results}' (format parquet)", "this is a COPY statement"),
        ("create table mine as select 1", "this is a CREATE statement"),
        ("select 1; select 2", "one question at a time, not 2 statements"),
        ("set enable_external_access = true", "this is a SET statement"),
        ("", "what is the question"),
        ("-- nothing", "what is the question"),
        ("select * from read_text('{mark}')", "disabled by configuration"),
        ("select * from query('copy (select 1) to ''{results}''')", "Expected a single SELECT statement"),
        ("select speling from results", 'Referenced column "speling" not found'),
    ],
)
def test_a_question_changes_nothing_and_sees_no_files(folder, specs, question, line):
    store(folder, specs[0])
    folder.tidy(now=True)
    before = folder.results.read_bytes()
    with pytest.raises(InputError, match=f"^sql: .*{line}") as refused:
        query(folder.path, question.format(results=folder.results, mark=folder.path / "batch.json"))
    assert "\n" not in str(refused.value)
    assert "LINE" not in str(refused.value)
    assert folder.results.read_bytes() == before


def test_answers_are_values_of_python(folder, specs):
    for spec in specs[:2]:
        store(folder, spec)
    (row,) = query(folder.path, "select now(), sum(attempts), count(*), count(*), null from runs").rows
    assert row[0].tzinfo is not None
    assert row[1:] == (2, 2, 2, None)
    assert [type(value) for value in row[1:4]] == [int, int, int]


def test_a_merge_between_listing_and_reading_hides_no_run_from_questions(folder, specs, monkeypatch):
    def unmerged(batch):
        found = list_unmerged(batch)
        if not listed:
            listed.append(found)
            folder.tidy(now=True)
        return found

    listed = []
    list_unmerged = BatchFolder.unmerged
    for spec in specs[:2]:
        store(folder, spec)
    monkeypatch.setattr(BatchFolder, "unmerged", unmerged)
    assert query(folder.path, "select count(*) from runs").rows == ((2,),)
    assert len(listed[0]) == 2
