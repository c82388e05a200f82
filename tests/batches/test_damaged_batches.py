"""Damaged batch folders: one line that names file and column, and nothing is written outside of the folder."""

from __future__ import annotations

import shutil
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner

from interdrive.batches import batch
from interdrive.cli import main

pytestmark = pytest.mark.long

COMMANDS = (("report", "batch", "--quiet"), ("compare", "batch", "--quiet"), ("sql", "batch", "select * from results"))


@pytest.fixture(scope="module")
def sound(tmp_path_factory) -> Path:
    """Two planners on one scenario, run folders kept."""
    folder = tmp_path_factory.mktemp("sound") / "batch"
    batch(
        ["lane_merge"], folder, planner="idm,idm_mobil", predictor="constant_velocity", agents=1, keep="all", workers=1
    )
    return folder


@pytest.fixture
def folder(sound, tmp_path, monkeypatch) -> Path:
    """A copy, called `batch` in the working folder, beside a run folder that is none of its business."""
    monkeypatch.chdir(tmp_path)
    kept = next((sound / "recordings").iterdir())
    shutil.copytree(kept, tmp_path / "foreign")
    return Path(shutil.copytree(sound, tmp_path / "batch"))


def content(folder: Path) -> dict[str, bytes | None]:
    return {str(path): path.read_bytes() if path.is_file() else None for path in sorted(folder.rglob("*"))}


def refusals(folder, *commands) -> list[str]:
    """What every command says; nothing may be written."""
    before, lines = content(folder.parent), []
    for command in commands or COMMANDS:
        done = CliRunner().invoke(main, command)
        assert (done.exit_code, done.stdout) == (2, ""), (command, done.output, done.exception)
        assert done.stderr.startswith("error: ")
        assert done.stderr.count("\n") == 1
        lines.append(done.stderr)
    assert content(folder.parent) == before
    return lines


def with_cell(folder: Path, column: str, value: object) -> None:
    """Another value in the first row of the data set."""
    path = folder / "results.parquet"
    table = pq.read_table(path)
    values = table[column].to_pylist()
    field = table.schema.field(column)
    changed = pa.array([value, *values[1:]], field.type if not isinstance(value, list) else None)
    pq.write_table(table.set_column(table.column_names.index(column), field.with_type(changed.type), changed), path)


@pytest.mark.parametrize(
    ("column", "value", "words"),
    [
        ("key", "../../foreign", "key: '../../foreign' is not 32 hexadecimal digits"),
        ("key", "/tmp", "key: '/tmp' is not 32 hexadecimal digits"),
        ("key", "A" * 32, "is not 32 hexadecimal digits"),
        ("status", "won", "status: 'won' is not one of finished, refused, "),
        ("traffic", "calm", "traffic: 'calm' is not one of recorded, velocity_adjusting, same"),
        ("outcome", "won", "outcome: 'won' is not one of goal_reached, "),
        ("outcome", None, "outcome: a value is missing"),
        ("agent_id", None, "agent_id: a value is missing"),
        ("jerk_rms", float("inf"), "jerk_rms: inf in row 0 is too large"),
    ],
)
def test_a_value_that_no_batch_writes(folder, column, value, words):
    with_cell(folder, column, value)
    for line in refusals(folder, *COMMANDS[:2]):
        assert words in line
        assert "batch/results.parquet: " in line


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda table: table.drop_columns(["seed"]), "its columns differ from those of this version (seed differs)"),
        (lambda table: table.set_column(8, "seed", table["seed"].cast("string")), "seed: values of type string"),
        (lambda table: table.set_column(8, "seed", table["seed"].cast("double")), "seed: values of type double"),
        (lambda table: table.select(table.column_names[::-1]), "(their order differs)"),
    ],
)
def test_columns_that_no_batch_writes(folder, change, words):
    path = folder / "results.parquet"
    pq.write_table(change(pq.read_table(path)), path)
    for line in refusals(folder):
        assert words in line


@pytest.mark.parametrize(
    ("mark", "words"),
    [
        (b'{"format": "2"}', "a batch of format unknown"),
        (b'{"format": true}', "a batch of format True"),
        (b'{"format": [' + b"[" * 100_000, "batch.json: cannot be read: it is nested too deeply"),
        (b'{"format": NaN}', "batch.json: cannot be read: NaN is not a JSON number"),
        (b"\xff\xfe", "batch.json: cannot be read: "),
        (b"[]", "a batch of format unknown"),
    ],
)
def test_a_mark_that_no_batch_writes(folder, mark, words):
    (folder / "batch.json").write_bytes(mark)
    for line in refusals(folder):
        assert words in line


def test_half_a_data_set(folder):
    path = folder / "results.parquet"
    path.write_bytes(path.read_bytes()[:-100])
    for line in refusals(folder):
        assert "results.parquet: cannot be read: " in line


@pytest.mark.parametrize("name", ["results.parquet", "runs", "recordings", ".stored", ".locks", "batch.json"])
def test_a_batch_folder_with_a_link_in_it_is_refused(folder, name):
    part = folder / name
    if part.exists():
        part.rename(folder.parent / "elsewhere")
    part.symlink_to(folder.parent / "elsewhere")
    for line in refusals(folder, *COMMANDS, ("batch", "lane_merge", "--planner", "idm", "--out", "batch", "--quiet")):
        assert f"batch/{name}: this is a symbolic link" in line


def test_a_batch_folder_with_a_link_for_a_recording_is_refused(folder):
    kept = sorted((folder / "recordings").iterdir())[0]
    shutil.rmtree(kept)
    kept.symlink_to(folder.parent / "foreign")
    for line in refusals(folder):
        assert f"batch/recordings/{kept.name}: this is a symbolic link" in line


def test_a_batch_folder_with_a_link_for_a_run_is_refused(folder):
    (folder / "runs").mkdir(exist_ok=True)
    run = folder / "runs" / f"{32 * '0'}.parquet"
    run.symlink_to(folder / "results.parquet")
    for line in refusals(folder):
        assert f"batch/runs/{run.name}: this is a symbolic link" in line


def test_a_batch_is_not_written_through_a_link_to_its_folder(folder):
    Path("link").symlink_to(folder)
    for line in refusals(folder, ("batch", "lane_merge", "--planner", "idm", "--out", "link", "--quiet")):
        assert line.startswith("error: link: this is a symbolic link; ")


def test_a_file_of_a_run_with_another_name_or_key_is_refused(folder):
    table = pq.read_table(folder / "results.parquet")
    key = table["key"].to_pylist()[0]
    (folder / "runs").mkdir(exist_ok=True)
    one = table.filter(pc.equal(table["key"].cast("string"), key))
    pq.write_table(one, folder / "runs" / "mine.parquet")
    assert all("mine.parquet: key: 'mine' is not 32 hexadecimal" in line for line in refusals(folder))
    (folder / "runs" / "mine.parquet").rename(folder / "runs" / f"{'0' * 32}.parquet")
    assert all("it belongs to another run" in line for line in refusals(folder))
