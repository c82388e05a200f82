"""`interdrive predict-eval`: what it prints, what it writes, what it refuses."""

import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner

from interdrive.cli import main
from interdrive.cli.predict_eval import named_predictors
from interdrive.errors import InputError
from interdrive.prediction_evaluation import evaluate_predictors


def run(*arguments):
    return CliRunner().invoke(main, ["predict-eval", *map(str, arguments)])


@pytest.fixture(scope="module")
def evaluated(tmp_path_factory):
    folder = tmp_path_factory.mktemp("evaluated") / "found"
    choices = "constant_velocity,lane_following,lane_following,modes_max=1,return_time=2.0"
    return run("lane_merge", "--predictors", choices, "--every", 20, "--out", folder), folder


def test_its_tables_fit_into_110_columns(evaluated):
    done, _ = evaluated
    assert done.exit_code == 0, done.stderr
    assert max(len(line) for line in done.stdout.splitlines() if "results in" not in line) <= 110
    titles = ("most probable mode [m]", "best mode [m]", "negative log-likelihood", "displacement")
    assert all(title in done.stdout for title in titles)
    assert all(row in done.stdout for row in ("all samples", "mean of categories", "merge"))


def test_it_writes_a_row_per_predictor_and_category(evaluated):
    _, folder = evaluated
    assert {entry.name for entry in folder.iterdir()} == {
        *("measures.parquet", "calibration.parquet", "error_over_time.parquet", "evaluation.json")
    }
    table = pq.read_table(folder / "measures.parquet").to_pandas()
    assert table["predictor"].unique().tolist() == [
        *("constant_velocity", "lane_following", "lane_following,modes_max=1,return_time=2.0")
    ]
    assert len(table) == 3 * 3


def test_what_is_there_is_replaced_only_with_overwrite(evaluated, tmp_path):
    folder = tmp_path / "found"
    options = ("lane_merge", "--predictors", "constant_velocity", "--every", 60)
    assert run(*options, "--out", folder, "--quiet").exit_code == 0
    again = run(*options, "--out", folder)
    assert (again.exit_code, "already exists there" in again.stderr) == (2, True)
    assert run(*options, "--out", folder, "--overwrite").exit_code == 0


def test_settings_belong_to_the_predictor_in_front():
    assert named_predictors("all") == ["all"]
    assert named_predictors("a, m:B,x=1, y=[2,3] ,all") == ["a", "m:B,x=1,y=[2,3]", "all"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((), "predict-eval: no recordings"),
        (("lane_merge", "--predictors", "lane_folowing"), "did you mean lane_following?"),
        (("lane_merge", "--predictors", "lane_following,modes=1"), "modes"),
        (("lane_merge", "--predictors", "all,modes_max=1"), "modes_max=1 belongs to no predictor"),
        (("lane_merge", "--predictors", "nowhere:Mine"), "module nowhere cannot be imported"),
        (("lane_merge", "--every", "0"), "--every"),
        (("nothing.xml",), "nothing.xml: no such file"),
        (("lane_merge", "--split", "nothing.toml"), "no such file"),
        (("lane_merge", "--set", "predictor.horizon=-1"), "predictor.horizon"),
    ],
)
def test_what_cannot_be_used_is_one_line_and_nothing_is_written(arguments, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = run(*arguments)
    assert done.exit_code == 2
    assert words in done.stderr
    assert done.stderr.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_workers_share_the_files_and_change_nothing(tmp_path):
    options = ("--predictors", "lane_following", "--every", 40, "--samples")
    tables = []
    for workers in (1, 2):
        folder = tmp_path / str(workers)
        done = run("t_junction", "lane_merge", *options, "--workers", workers, "--out", folder)
        assert done.exit_code == 0, done.stderr
        tables.append(pq.read_table(folder / "samples.parquet"))
    assert tables[0].num_rows > 0
    assert tables[0].equals(tables[1])


def test_workers_refuse_a_predictor_that_they_cannot_find():
    class Mine:
        def predict(self, scene):
            raise NotImplementedError

    with pytest.raises(InputError, match="it is defined in a function, where other processes do not find it"):
        evaluate_predictors(["t_junction", "lane_merge"], Mine, workers=2)
