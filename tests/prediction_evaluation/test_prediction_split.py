"""Splits of recordings by place: which vehicles are judged, in which part, and which traffic it is."""

import numpy as np
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner

import interdrive as idr
from interdrive.cli import main
from interdrive.prediction_evaluation.tables import ALL, ANY, MEAN, measures_table

SPLIT = """
[[place]]
files = ["lane_*"]
part = "validation"
category = "highway"

[[place]]
files = ["t_junction", "highway"]
part = "a"
category = "urban"
"""


def test_a_split_says_which_files_are_judged_and_their_category(tmp_path):
    (tmp_path / "split.toml").write_text(SPLIT)
    files = ["lane_merge", "t_junction", "highway", "intersection"]
    found = idr.evaluate_predictors(files, "constant_velocity", every=50, split=tmp_path / "split.toml")
    assert [path.stem for path in found.files] == ["lane_merge"]
    assert set(found.samples.category) == {"highway"}
    assert "1 files; 2 of other parts, 1 without a place" in found.notes[0]


@pytest.mark.parametrize(
    ("text", "part", "words"),
    [
        (SPLIT, "b", "there is no part 'b'; there are validation, a"),
        (SPLIT.replace("lane_", "other_"), "validation", "none of the 1 files is of the part validation"),
        ("x = [", "validation", "cannot be read as TOML"),
        ("x = 1", "validation", "there is no table"),
        ('[[place]]\nname = "A"\nfiles = "a*"', "validation", "place A: files must be a list of patterns"),
        ('[[place]]\nfiles = ["a*"]\npart = 1', "validation", "place number 1: part and category must be texts"),
        (SPLIT + 'traffic = "real"\n', "validation", "traffic is 'real', but must be one of recorded, simulated"),
    ],
)
def test_a_split_that_cannot_be_used_is_refused_in_one_line(tmp_path, text, part, words):
    (tmp_path / "split.toml").write_text(text)
    with pytest.raises(idr.InputError, match=words):
        idr.evaluate_predictors("lane_merge", "constant_velocity", split=tmp_path / "split.toml", part=part)


KINDS = """
[[place]]
files = ["t_junction"]
part = "validation"
category = "junction"
traffic = "simulated"

[[place]]
files = ["highway", "lane_merge"]
part = "validation"
category = "highway"
traffic = "recorded"
"""


def test_recorded_and_simulated_traffic_are_told_apart(tmp_path):
    (tmp_path / "split.toml").write_text(KINDS)
    done = CliRunner().invoke(
        main,
        [
            *("predict-eval", "highway", "t_junction", "lane_merge", "--predictors", "constant_velocity"),
            *("--split", str(tmp_path / "split.toml"), "--every", "20", "--samples"),
            *("--out", str(tmp_path / "found")),
        ],
    )
    assert done.exit_code == 0, done.stderr
    titles = [done.stdout.index(f"{traffic} traffic: ") for traffic in ("recorded", "simulated")]
    assert titles == sorted(titles)
    assert max(len(line) for line in done.stdout.splitlines() if str(tmp_path) not in line) <= 110
    rows = pq.read_table(tmp_path / "found" / "measures.parquet").to_pylist()
    assert [(row["traffic"], row["category"]) for row in rows] == [
        *((ANY, name) for name in ("highway", "junction", ALL, MEAN)),
        *(("recorded", name) for name in ("highway", ALL, MEAN)),
        *(("simulated", name) for name in ("junction", ALL, MEAN)),
    ]
    by_traffic = {row["traffic"]: row for row in rows if row["category"] == ALL}
    parts = [by_traffic["recorded"], by_traffic["simulated"]]
    whole = by_traffic[ANY]
    assert whole["samples_3"] == sum(part["samples_3"] for part in parts)
    assert whole["fde_3"] * whole["samples_3"] == pytest.approx(sum(p["fde_3"] * p["samples_3"] for p in parts))
    samples = pq.read_table(tmp_path / "found" / "samples.parquet").to_pandas()
    assert set(samples[samples["traffic"] == "simulated"]["file"]) == {"t_junction.xml"}


def test_without_a_split_nothing_is_said_about_the_traffic():
    found = idr.evaluate_predictors("lane_merge", "constant_velocity", every=50)
    assert np.all(found.samples.traffic == "unknown")
    assert {row["traffic"] for row in measures_table(found).to_pylist()} == {ANY}
