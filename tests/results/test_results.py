"""The run folder: what is in it, and that it is there whole or not at all."""

from __future__ import annotations

import errno
import hashlib
import json
import os
import resource
import sys
import types
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars
import pyarrow as pa
import pytest
from invented_run import invented_run
from work import calls_in

import interdrive
from interdrive import results, storage
from interdrive.errors import InputError, ResultsError
from interdrive.results import check_target, outcome_table, plans_table, read_results, save, states_table, timing_table
from interdrive.run import Plans
from interdrive.storage import replacing

FILES = [
    "outcomes.parquet",
    "plans.parquet",
    "routes.parquet",
    "run.json",
    "scenario.xml",
    "states.parquet",
    "timing.parquet",
]


@pytest.fixture(autouse=True)
def _plain_scenario_writer(monkeypatch):
    writer = types.ModuleType("interdrive.files")
    writer.run_document = lambda run: f"<commonRoad benchmarkID='{run.scenario.benchmark_id}'/>".encode()
    writer.road_losses = lambda _: ()
    monkeypatch.setitem(sys.modules, "interdrive.files", writer)
    monkeypatch.setattr(interdrive, "files", writer, raising=False)


@pytest.fixture(scope="module")
def run():
    return invented_run()


def with_plans(run, n_plans, n_points=31):
    """The run with so many invented plans of 3 s, 24 in a step."""
    chance = np.random.default_rng(0)
    step, agent = np.divmod(np.arange(n_plans), 24)
    ways = [np.cumsum(chance.normal(size=(n_plans, n_points)), axis=1) for _ in range(5)]
    planned, nowhere = np.ones(n_plans, dtype=np.int64), [np.full(n_plans, np.nan)] * 4
    return replace(run, plans=Plans(step, agent, planned, np.ones(n_plans), *ways, ("",) * n_plans, *nowhere))


def contents(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_a_saved_run_can_be_loaded_and_says_the_same(run, tmp_path):
    folder = save(run, tmp_path / "made" / "on the way")
    assert contents(folder) == FILES
    loaded = read_results(folder)
    assert loaded.outcomes.equals(outcome_table(run))
    assert loaded.states.equals(states_table(run))
    assert loaded.plans.equals(plans_table(run))
    assert loaded.timing.equals(timing_table(run))
    assert loaded.info["digest"] == run.digest
    assert loaded.info["settings"]["settings"]["goal.time_early"] == "inf"
    assert loaded.info["scenario"]["benchmark_id"] == "ZAM_Bend-1_1_T-1"


def test_outcomes_have_one_row_per_agent_and_null_for_what_did_not_happen(run):
    frame = outcome_table(run).to_pandas()
    assert list(frame.agent_id) == [1, 2, 3, 4]
    assert list(frame.outcome) == ["goal_reached", "collision", "goal_reached_late", "planner_error"]
    assert outcome_table(run)["partner_id"].to_pylist() == [None, 22, None, None]
    assert outcome_table(run)["impact_speed"].to_pylist() == [None, 17.0, None, None]


def test_states_have_one_row_per_present_participant_sorted_by_time_then_id(run):
    table = states_table(run)
    assert table.num_rows == run.states.valid.sum()
    steps, ids = table["time_step"].to_numpy(), table["participant_id"].to_numpy()
    assert list(zip(steps, ids, strict=True)) == sorted(zip(steps, ids, strict=True))
    bus = polars.from_arrow(table).filter(polars.col("participant_id") == 4)
    assert bus["time_step"].to_list() == list(range(5, 40))
    assert set(bus["kind"]) == {"bus"}
    assert bus["length"].to_list() == [12.0] * 35
    np.testing.assert_array_equal(bus["x"], run.states.x[3, 5:40])


def test_states_are_stored_to_the_last_bit(run, tmp_path):
    stored = read_results(save(run, tmp_path / "run")).states["x"].to_numpy()
    assert stored.dtype == np.float64
    np.testing.assert_array_equal(stored, run.states.x.T[run.states.valid.T])


def test_plans_end_where_they_end_and_a_plan_without_points_keeps_its_status(run):
    frame = polars.from_arrow(plans_table(run))
    at_start = frame.filter(polars.col("time_step") == 0)
    assert dict(at_start.group_by("agent_id").len().iter_rows()) == {1: 31, 2: 31, 3: 21}
    broken = frame.filter((polars.col("agent_id") == 4) & (polars.col("time_step") == 39))
    assert broken["status"].to_list() == ["error"]
    assert broken["x"].to_list() == [None]


def test_plans_without_any_points_are_a_table_of_statuses(run):
    nothing, unknown = np.empty((2, 0)), np.full(2, np.nan)
    status = np.array([3, 0])
    plans = Plans(
        np.array([0, 1]), np.array([1, 1]), status, unknown, *[nothing] * 5, ("off the road", ""), *[unknown] * 4
    )
    table = plans_table(replace(run, plans=plans))
    assert table["status"].to_pylist() == ["infeasible", "none"]
    assert table["cost"].null_count == 2


def test_phases_of_a_step_add_up_in_the_timing_table(run):
    frame = polars.from_arrow(timing_table(run)).group_by("time_step").agg(polars.col("seconds").sum())
    assert frame["seconds"].to_list() == pytest.approx([0.017] * 60)


def test_the_same_run_gives_the_same_bytes(run, tmp_path):
    first, second = save(run, tmp_path / "a"), save(run, tmp_path / "b")
    for name in FILES:
        assert (first / name).read_bytes() == (second / name).read_bytes(), name


def test_every_column_says_what_it_means_in_the_file(run, tmp_path):
    outcomes = read_results(save(run, tmp_path / "run")).outcomes
    assert outcomes.schema.field("impact_speed").metadata[b"description"].endswith(b"[m/s]")


def test_run_json_is_strict_json_and_names_versions_and_seed(run, tmp_path):
    def refuse(constant):
        raise AssertionError(constant)

    info = json.loads((save(run, tmp_path / "run") / "run.json").read_text(), parse_constant=refuse)
    assert set(info["versions"]) == {"interdrive", "python", "numpy", "commonroad-io"}
    assert info["seed"] == 0
    assert info["notes"] == list(run.notes)


def test_a_run_is_replaced_only_on_request(run, tmp_path):
    folder = save(run, tmp_path / "run")
    with pytest.raises(ResultsError, match="a run already exists there"):
        save(run, folder)
    save(replace(run, digest="1" * 64), folder, overwrite=True)
    assert read_results(folder).info["digest"] == "1" * 64
    assert contents(tmp_path) == ["run"]


def test_the_old_run_is_back_when_the_new_one_cannot_take_its_place(run, tmp_path, monkeypatch):
    folder = save(run, tmp_path / "run")
    rename = Path.rename

    def refuse(path, target):
        if ".partial" in path.name:
            raise OSError(errno.EACCES, os.strerror(errno.EACCES))
        return rename(path, target)

    monkeypatch.setattr(Path, "rename", refuse)
    with pytest.raises(ResultsError, match="run: cannot be written: Permission denied"):
        save(replace(run, digest="1" * 64), folder, overwrite=True)
    assert read_results(folder).info["digest"] == run.digest
    assert contents(tmp_path) == ["run"]


@pytest.mark.parametrize("names", [["thesis.tex"], ["run.json", "thesis.tex"], ["run.png"]])
def test_a_folder_with_other_things_is_never_touched(run, tmp_path, names):
    for name in names:
        (tmp_path / name).write_text("precious")
    with pytest.raises(ResultsError, match="is not replaced"):
        save(run, tmp_path, overwrite=True)
    assert contents(tmp_path) == sorted(names)


def test_an_empty_folder_may_be_used_and_a_file_may_not(run, tmp_path):
    (tmp_path / "empty").mkdir()
    save(run, tmp_path / "empty")
    (tmp_path / "file").write_text("")
    with pytest.raises(ResultsError, match="a file with this name already exists"):
        save(run, tmp_path / "file")
    with pytest.raises(ResultsError, match="is not a folder"):
        save(run, tmp_path / "file" / "run")


@pytest.fixture
def on_disk(monkeypatch):
    """Inode and size of what has reached the disk."""
    found, real = set(), os.fsync

    def fsync(handle):
        real(handle)
        found.add((os.fstat(handle).st_ino, os.fstat(handle).st_size))

    monkeypatch.setattr(os, "fsync", fsync)
    return found


def test_files_and_folders_reach_the_disk_before_they_take_their_names(tmp_path, monkeypatch, on_disk):
    def checked(real):
        def moved(path, target):
            written = [path, *path.rglob("*")]
            assert {(one.stat().st_ino, one.stat().st_size) for one in written if one.is_file()} <= on_disk
            moves.append(Path(target).name)
            return real(path, target)

        return moved

    moves = []
    monkeypatch.setattr(Path, "replace", checked(Path.replace))
    with replacing(tmp_path / "file.txt") as partial:
        partial.write_text("content")
    with replacing(tmp_path / "new" / "folder") as partial:
        (partial / "deep").mkdir(parents=True)
        (partial / "deep" / "file").write_text("content")
    assert moves == ["file.txt", "folder"]
    assert (tmp_path.stat().st_ino, tmp_path.stat().st_size) in on_disk


def test_two_threads_may_write_the_same_file(tmp_path):
    with replacing(tmp_path / "file") as first, replacing(tmp_path / "file") as second:
        first.write_text("first")
        second.write_text("second")
        assert first != second
    assert contents(tmp_path) == ["file"]
    assert (tmp_path / "file").read_text() == "first"


@pytest.mark.parametrize("failing", FILES)
def test_a_full_disk_leaves_nothing_behind_and_says_so_in_one_line(run, tmp_path, monkeypatch, failing):
    real = os.fsync
    synced = []

    def fsync(handle):
        synced.append(Path(f"/proc/self/fd/{handle}").readlink().name)
        if synced[-1] == failing:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        real(handle)

    monkeypatch.setattr(os, "fsync", fsync)
    with pytest.raises(ResultsError) as refused:
        save(run, tmp_path / "deep" / "run")
    assert str(refused.value) == f"{tmp_path / 'deep' / 'run'}: cannot be written: No space left on device"
    assert contents(tmp_path) == []


def test_a_writer_that_fails_half_way_keeps_the_old_run(run, tmp_path, monkeypatch):
    # Python would store half of its compiled modules, too, and read them ever after.
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    folder = save(run, tmp_path / "run")
    before = {name: hashlib.sha256((folder / name).read_bytes()).hexdigest() for name in FILES}
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, hard))
    try:
        with pytest.raises(ResultsError, match="File too large"):
            save(run, folder, overwrite=True)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert {name: hashlib.sha256((folder / name).read_bytes()).hexdigest() for name in FILES} == before
    assert contents(tmp_path) == ["run"]


@pytest.mark.parametrize("raised", [KeyboardInterrupt, InputError("no lanelets")])
def test_an_interrupt_or_a_failing_part_leaves_nothing_behind(run, tmp_path, monkeypatch, raised):
    def stop(_):
        raise raised

    monkeypatch.setattr(interdrive.files, "run_document", stop)
    with pytest.raises(raised if isinstance(raised, type) else type(raised)):
        save(run, tmp_path / "run")
    assert contents(tmp_path) == []


def test_an_unwritable_folder_is_refused_before_anything_happens(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "access", lambda *_: False)
    with pytest.raises(ResultsError, match="no permission to write"):
        check_target(tmp_path / "run")


def test_a_folder_that_refuses_new_entries_is_an_error_in_one_line(run, tmp_path, monkeypatch):
    def mkdir(*_args, **_kwargs):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))

    monkeypatch.setattr(Path, "mkdir", mkdir)
    with pytest.raises(ResultsError, match="run: cannot be written: Permission denied"):
        save(run, tmp_path / "run")


def test_loading_names_the_file_that_is_missing_or_damaged(run, tmp_path):
    with pytest.raises(ResultsError, match="nowhere: this is not a run folder"):
        read_results(tmp_path / "nowhere")
    folder = save(run, tmp_path / "run")
    (folder / "plans.parquet").write_bytes(b"PAR1 but not really")
    with pytest.raises(ResultsError, match=r"plans.parquet: cannot be read: "):
        read_results(folder)
    (folder / "plans.parquet").unlink()
    with pytest.raises(ResultsError, match=r"plans.parquet: this file of the run is missing"):
        read_results(folder)
    storage.write_parquet(pa.table({"a": [1]}), folder / "plans.parquet", storage.Origin())
    with pytest.raises(ResultsError, match=r"plans.parquet: the columns are not those of a run \(a\)"):
        read_results(folder)
    for text, message in (
        (
            '{"format": 1}',
            rf"run.json: format 1 is that of an older interdrive, this version reads {results.FORMAT}; simulate",
        ),
        (
            '{"format": 99}',
            rf"run.json: format 99 is newer than what this interdrive reads \({results.FORMAT}\); update it",
        ),
        ('{"agents": 3}', "run.json: it states no format, so this is not a run folder"),
    ):
        (folder / "run.json").write_text(text)
        with pytest.raises(ResultsError, match=message):
            read_results(folder)
    (folder / "run.json").write_text("{")
    with pytest.raises(ResultsError, match=r"run.json: cannot be read"):
        read_results(folder)


def test_a_replaced_file_is_whole_or_as_it_was(tmp_path):
    target = tmp_path / "run.png"
    with replacing(target) as path:
        path.write_text("whole")
    with pytest.raises(ResultsError, match=r"run.png: cannot be written: No space"), replacing(target) as path:
        path.write_text("half")
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    assert target.read_text() == "whole"
    (tmp_path / "folder.png").mkdir()
    with (
        pytest.raises(ResultsError, match=r"folder.png: cannot be written: Is a directory"),
        replacing(tmp_path / "folder.png") as path,
    ):
        path.write_text("a file")
    (tmp_path / "folder.png").rmdir()
    assert contents(tmp_path) == ["run.png"]


def test_a_link_is_replaced_and_what_it_points_to_is_left_alone(tmp_path):
    (tmp_path / "precious.html").write_text("precious")
    (tmp_path / "precious").mkdir()
    (tmp_path / "precious" / "file").write_text("precious")
    for link, target in (("page.html", "precious.html"), ("folder", "precious"), ("nowhere", "missing")):
        (tmp_path / link).symlink_to(tmp_path / target)
    with replacing(tmp_path / "page.html") as path:
        path.write_text("page")
    for name in ("folder", "nowhere"):
        with replacing(tmp_path / name) as path:
            path.mkdir()
            (path / "run").write_text("run")
    assert (tmp_path / "precious.html").read_text() == "precious"
    assert contents(tmp_path / "precious") == ["file"]
    assert not any(path.is_symlink() for path in tmp_path.iterdir())
    assert contents(tmp_path) == ["folder", "nowhere", "page.html", "precious", "precious.html"]


def test_json_has_words_for_infinities_and_null_for_nan():
    text = storage.json_text({"a": [float("inf"), -np.inf, float("nan")], "b": np.array([1.0, np.nan]), "c": np.True_})
    assert text == '{"a":["inf","-inf",null],"b":[1.0,null],"c":true}'


def test_python_does_nothing_for_a_single_plan_that_is_written(run, tmp_path):
    save(run, tmp_path / "warm up")
    few, many = (with_plans(run, 24 * n_steps) for n_steps in (14, 140))
    calls_few = calls_in(lambda: save(few, tmp_path / "few"))
    assert calls_in(lambda: save(many, tmp_path / "many")) < 1.05 * calls_few
