"""The folder of a batch: what reaches the disk, what may happen at once, what it costs. Its runs are not driven."""

import hashlib
import os
import re
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner

import interdrive.batches.store as folder_module
from interdrive.batches import BatchFolder, query
from interdrive.batches.job import failed, no_rows
from interdrive.batches.plan import planned
from interdrive.batches.pool import End
from interdrive.batches.query import MEMORY, SECONDS
from interdrive.batches.run import _conduct, _Queue
from interdrive.cli import main
from interdrive.config.schema import SimulationSettings
from interdrive.errors import InputError

pytestmark = pytest.mark.long


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
        ("select 1; select 2", "one query at a time, not 2 statements"),
        ("set enable_external_access = true", "this is a SET statement"),
        ("", "the query is empty"),
        ("-- nothing", "the query is empty"),
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


def test_the_help_of_sql_states_the_limits_of_a_question():
    shown = " ".join(CliRunner().invoke(main, ["sql", "--help"]).output.split())
    assert f"Time limit of the query ({SECONDS:g})." in shown
    assert f"Memory limit of the query ({MEMORY / 2**30:g}G)." in shown


@pytest.mark.parametrize(
    "question",
    [
        "select count(*) from range(100000000000)",
        "select * from range(100000000000)",
        "with recursive t(n) as (select 1 union all select n + 1 from t) select max(n) from t",
    ],
)
def test_a_question_without_end_is_given_up(folder, specs, question):
    store(folder, specs[0])
    with pytest.raises(InputError, match=r"^sql: no result after 0\.5 s; --timeout SECONDS gives it more time$"):
        query(folder.path, question, seconds=0.5)


@pytest.mark.parametrize(
    ("question", "line"),
    [
        (
            "select list(range) from range(1000000000)",
            "the query needs more memory than 57 MiB; --memory SIZE",
        ),
        (
            "select 'x' || range as text from range(10000000)",
            "the result has more than [0-9]+ rows, which need more",
        ),
    ],
)
def test_a_question_whose_answer_does_not_fit_is_given_up(folder, specs, question, line):
    store(folder, specs[0])
    with pytest.raises(InputError, match=f"^sql: {line}"):
        query(folder.path, question, memory=60e6)


def test_a_single_call_without_end_ends_the_command(folder, specs):
    store(folder, specs[0])
    question = "select length(repeat('x', 4000000000))"
    words = [sys.executable, "-m", "interdrive", "sql", folder.path, question, "--timeout", "1", "--memory", "100M"]
    done = subprocess.run(words, capture_output=True, text=True, check=False, timeout=60)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.count("\n") == 1
    assert re.match("error: sql: (the query needs more memory than 100 MiB|no result after 1 s)", done.stderr)


def test_a_folder_that_another_batch_makes_while_it_is_looked_at_is_shared(tmp_path, monkeypatch):
    check, place = folder_module.check_folder, tmp_path / "new"

    def late(*arguments, **options):
        if not place.exists():
            place.mkdir()
            (place / ".batch.json.1-a.partial.json").write_text("{")
        return check(*arguments, **options)

    monkeypatch.setattr(folder_module, "check_folder", late)
    assert BatchFolder.create(place).table().num_rows == 0


def test_rows_that_were_withdrawn_are_gone_before_they_are_merged(folder, specs):
    store(folder, specs[0])
    folder.tidy(now=True)
    folder.store(specs[0].key, no_rows())
    assert folder.table().num_rows == 0
    assert query(folder.path, "select count(*) from results").rows == ((0,),)


def test_a_line_that_was_written_on_a_full_disk_is_passed_over(folder, specs):
    with (folder.path / ".stored").open("ab") as file:
        file.write(f"{specs[0].key} crashed".encode())
    assert folder.stored_since(specs[1].key) is None
    store(folder, specs[0])  # its line goes on where the half one ends
    store(folder, specs[1])
    assert folder.stored_since(specs[1].key).status == "crashed"


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


def status(folder):
    table = folder.table()
    return dict(zip(table["key"].to_pylist(), table["status"].to_pylist(), strict=True))


@pytest.mark.parametrize("is_still_claimed", [True, False])
def test_a_run_that_is_done_again_while_it_is_merged_is_not_lost(folder, specs, monkeypatch, is_still_claimed):
    def merge(into, parts):
        real_merge(into, parts)
        assert other.claim(specs[0].key)
        store(other, specs[0], "finished", "")
        if not is_still_claimed:
            other.release(specs[0].key)

    other, real_merge = BatchFolder.open(folder.path), folder_module.merge
    for spec in specs[:2]:
        store(folder, spec)
    monkeypatch.setattr(folder_module, "merge", merge)
    folder.tidy(now=True)
    monkeypatch.undo()
    assert [part.stem for part in folder.unmerged()] == [specs[0].key]
    assert status(folder) == {specs[0].key: "finished", specs[1].key: "crashed"}
    other.close()
    folder.tidy(now=True)
    assert not folder.unmerged()
    assert status(folder) == {specs[0].key: "finished", specs[1].key: "crashed"}


class InOrder:
    """Does tasks in this process and calls `between` before each."""

    def __init__(self, status, between):
        self.status, self.between, self.done = status, between, []

    def run(self, _function, take):
        self.between()
        while task := take(""):
            spec = task.payload.spec
            self.done.append(spec.key)
            yield End(task, failed(spec, self.status, "", 1))
            self.between()

    def close(self):
        pass


@pytest.mark.parametrize("ended", ["finished", "crashed"])
def test_two_batches_that_retry_a_run_do_it_once_however_it_ends(folder, specs, ended):
    def conducted(batch, between=lambda: None):
        backend = InOrder(ended, between)
        _conduct(specs[:3], batch, backend, "none", None, send=False, on_progress=None)
        batch.tidy(now=True)
        return backend.done

    for spec in specs[:3]:
        store(folder, spec)
    first, second = BatchFolder.open(folder.path), BatchFolder.open(folder.path)
    assert set(first.done()) == set(second.done())
    there = []
    own = conducted(first, lambda: there or there.extend(conducted(second)))
    assert len(there) == 3
    assert own == []
    assert set(status(folder).values()) == {ended}


def test_claims_hold_between_folders_of_one_process_and_outlast_the_closing_of_others(folder, specs):
    key, other_key = specs[0].key, specs[1].key
    other = BatchFolder.open(folder.path)
    assert folder.claim(key)
    assert not folder.claim(key)
    assert not other.claim(key)
    assert other.claim(other_key)
    other.close()
    assert folder.claim(other_key)
    program = f"from interdrive.batches import BatchFolder; print(BatchFolder.open('{folder.path}').claim('{key}'))"

    def elsewhere():
        return subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout

    assert elsewhere() == "False\n"
    folder.release(key)
    assert elsewhere() == "True\n"


def test_threads_merge_one_after_the_other(folder, specs, monkeypatch):
    def merge(into, parts):
        at_work.append(into)
        assert len(at_work) == 1
        begun.set()
        assert go_on.wait(60)
        real_merge(into, parts)
        at_work.pop()

    def merged():
        BatchFolder.open(folder.path).tidy(now=True)

    at_work, begun, go_on, real_merge = [], threading.Event(), threading.Event(), folder_module.merge
    monkeypatch.setattr(folder_module, "merge", merge)
    store(folder, specs[0])
    with ThreadPoolExecutor() as threads:
        first = threads.submit(merged)
        assert begun.wait(60)
        second = threads.submit(merged)
        with pytest.raises(TimeoutError):
            second.result(0.05)
        go_on.set()
        first.result(60)
        second.result(60)
    assert status(folder) == {specs[0].key: "crashed"}


def test_files_of_runs_are_listed_only_when_there_may_be_many(folder, specs, monkeypatch):
    def unmerged(batch):
        found = list_unmerged(batch)
        listed.append(len(found))
        return found

    listed, list_unmerged = [], BatchFolder.unmerged
    monkeypatch.setattr(BatchFolder, "unmerged", unmerged)
    for spec in specs:
        store(folder, spec)
        folder.tidy()
    # When it begins, and whenever there are 64 or a quarter of what is merged, twice.
    assert listed == [1, *(2 * [64]), *(2 * [64]), *(2 * [64]), *(2 * [64])]
    assert len(list_unmerged(folder)) == 300 - 4 * 64
    assert len(status(folder)) == 300


class Counted(str):
    """Counts how often it is looked up."""

    __slots__ = ()
    lookups = 0

    def __hash__(self):
        Counted.lookups += 1
        return super().__hash__()


def test_the_next_scenario_is_found_without_looking_at_all_that_wait(specs):
    n = 2000
    waiting = [replace(specs[0], key=str(i), sha256=Counted(i), size=n - i // 2) for i in range(2 * n)]
    waiting = [replace(spec, sha256=waiting[i - i % 2].sha256) for i, spec in enumerate(waiting)]
    queue = _Queue(waiting, lambda _: True)
    Counted.lookups = 0
    first = queue.take("")
    assert queue.take(first.sha256).sha256 == first.sha256
    assert [queue.take("").key for _ in range(n - 1)] == [str(i) for i in range(2, 2 * n, 2)]
    assert Counted.lookups < 20 * n


def test_the_rows_of_some_runs_are_read_without_holding_all(folder, specs):
    """A file of 600 000 rows of other runs, of which a summary takes some columns."""
    store(folder, specs[0])
    folder.tidy(now=True)
    rows = folder.table()
    other = rows.set_column(0, rows.schema.field("key"), pa.array(["0" * 32], rows.schema.field("key").type))
    portion = pa.concat_tables([other] * 20_000).unify_dictionaries().combine_chunks()
    with pq.ParquetWriter(folder.results, rows.schema) as writer:
        for _ in range(30):
            writer.write_table(portion)
        writer.write_table(rows)
    program = f"""
import pyarrow as pa
from interdrive.batches import BatchSummary
found = BatchSummary({str(folder.path)!r}, ({specs[0].key!r},), 0, {{}}, 0.0).select(["status", "key"])
assert found.to_pylist() == [{{"status": "crashed", "key": {specs[0].key!r}}}]
print(pa.default_memory_pool().max_memory())
"""
    said = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout
    assert int(said) < 30 * portion.nbytes / 5


def test_what_a_killed_replacement_left_behind_is_removed_when_it_is_old(folder, monkeypatch):
    left = folder.path / "recordings" / ".key.1-abcdef01.old"
    left.mkdir(parents=True)
    os.utime(left, (0, 0))  # as old as the run folder, which gave way just now
    folder.tidy(now=True)
    assert left.exists()
    monkeypatch.setattr(folder_module, "_LEFTOVER_AGE", -1.0)
    folder.tidy(now=True)
    assert not left.exists()
