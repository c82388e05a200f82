"""Reference drivers against JRC-FSM 01b05c2, run as a black box, and `ad-rss` 5.0.0: tables of what they answered.

The three jrc_*.csv are rows of the result tables of that program, with its names of columns. jrc_grids.npz has its
answers for every row of these tables, that is for `interdrive.alks.grid(manoeuvre, "jrc")` in this order: `cut_in` the
type of the crash (0 none, 1 from the side, 2 from behind), `cut_out` and `following` whether there is one, and
`cut_out_leader` whether the leader hits what stands; columns in the order `cc`, `r157` (cut-ins only), `rss`, `fsm`.

To write it anew, run that program on its own grids, and call this file with a folder of its tables under the names
jrc_cut_in.csv, jrc_cut_out.csv and jrc_car_following.csv, with the columns of those here.
"""

import csv
import sys
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner

from interdrive.alks import grid
from interdrive.cli import main
from interdrive.reference_drivers import car_following, cut_in, cut_out, rss

FOLDER = Path(__file__).parent / "reference_drivers"
CUT_IN = {"cc": "CC_human_driver", "fsm": "FSM", "rss": "RSS", "r157": "Reg157"}
ORDER = ("cc", "r157", "rss", "fsm")
#: Crash flags of the whole grids that differ; all others are equal.
DIFFERENT = {
    ("cut_in", "cc"): 15,
    ("cut_in", "r157"): 30,
    ("cut_in", "rss"): 7,
    ("cut_in", "fsm"): 12,
    ("following", "fsm"): 4,
}
AHEAD = {name: column for name, column in CUT_IN.items() if name != "r157"}


def table(name):
    with (FOLDER / name).open(newline="") as file:
        return list(csv.DictReader(file))


def numbers(rows, name):
    return np.array([float(row[name]) for row in rows])


def flags(rows, name):
    return np.array([row[name] in ("1", "True") for row in rows])


@pytest.mark.parametrize("driver", CUT_IN)
def test_all_cut_ins_end_as_in_the_table(driver):
    rows = table("jrc_cut_in.csv")
    found = cut_in(
        driver,
        velocity=numbers(rows, "ego_kmh") / 3.6,
        other_velocity=numbers(rows, "other_kmh") / 3.6,
        gap=numbers(rows, "gap_m"),
        sideways=numbers(rows, "lateral_mps"),
    )
    kind = np.where(found.crash, np.where(found.is_beside, 1, 2), 0)
    assert len(rows) == 1512
    assert (found.crash == flags(rows, CUT_IN[driver])).all()
    assert (kind == numbers(rows, f"type_{CUT_IN[driver]}")).all()


@pytest.mark.parametrize("driver", AHEAD)
def test_all_cut_outs_end_as_in_the_table(driver):
    rows = table("jrc_cut_out.csv")
    found = cut_out(
        driver,
        velocity=numbers(rows, "velocity") / 3.6,
        front_distance=numbers(rows, "front_distance"),
        sideways=-numbers(rows, "lateral_velocities"),
    )
    assert len(rows) == 280
    assert (found.crash == flags(rows, f"Crash_{AHEAD[driver]}")).all()
    assert (found.leader_crash == flags(rows, f"Crash_front_{AHEAD[driver]}")).all()
    assert np.abs(found.kept_distance - numbers(rows, f"initial_distance_{AHEAD[driver]}")).max() < 1e-9


@pytest.mark.parametrize("driver", AHEAD)
def test_all_followings_end_as_in_the_table(driver):
    rows = table("jrc_car_following.csv")
    deceleration = 9.81 * numbers(rows, "max_deceleration")
    found = car_following(driver, velocity=numbers(rows, "velocity") / 3.6, deceleration=deceleration)
    difference = np.nan_to_num(found.impact_speed)
    assert len(rows) == 81
    assert (found.crash == flags(rows, f"Crash_{AHEAD[driver]}")).all()
    assert np.abs(found.kept_distance - numbers(rows, f"initial_distance_{AHEAD[driver]}")).max() < 1e-9
    assert np.abs(difference - numbers(rows, f"speed_difference_{AHEAD[driver]}")).max() < 1e-6


def places(cases, numbers_of):
    """Row of each case of a grid by its numbers, in the units of the tables."""
    columns = [np.round(cases[name] * factor, 4).tolist() for name, factor in numbers_of]
    return {key: row for row, key in enumerate(zip(*columns, strict=True))}


ANSWERS = {"False": 0, "True": 1, "0": 0, "1": 1, "2": 2}

#: By array of the file: table, manoeuvre, numbers of the grid and their factors, columns of the table and their signs,
#: columns of the answers.
PACKED = {
    "cut_in": (
        "jrc_cut_in.csv",
        "cut_in",
        (("velocity", 3.6), ("other_velocity", 3.6), ("gap", 1.0), ("sideways", 1.0)),
        (("ego_kmh", 1), ("other_kmh", 1), ("gap_m", 1), ("lateral_mps", 1)),
        [f"type_{CUT_IN[name]}" for name in ORDER],
    ),
    "cut_out": (
        "jrc_cut_out.csv",
        "cut_out",
        (("velocity", 3.6), ("front_distance", 1.0), ("sideways", 1.0)),
        (("velocity", 1), ("front_distance", 1), ("lateral_velocities", -1)),
        [f"Crash_{CUT_IN[name]}" for name in ORDER if name in AHEAD],
    ),
    "following": (
        "jrc_car_following.csv",
        "following",
        (("velocity", 3.6), ("deceleration", 1.0 / 9.81)),
        (("velocity", 1), ("max_deceleration", 1)),
        [f"Crash_{CUT_IN[name]}" for name in ORDER if name in AHEAD],
    ),
}
PACKED["cut_out_leader"] = (*PACKED["cut_out"][:4], [f"Crash_front_{CUT_IN[name]}" for name in ORDER if name in AHEAD])


def packed(name, folder=FOLDER):
    """Rows of the grid that a table of JRC-FSM has, and its answers there as the file has them."""
    file, manoeuvre, numbers_of, columns, answers = PACKED[name]
    place = places(grid(manoeuvre, "jrc").cases, numbers_of)
    rows, found = [], []
    with (folder / file).open(newline="") as table_file:
        for row in csv.DictReader(table_file):
            rows.append(place[tuple(round(sign * float(row[column]), 4) for column, sign in columns)])
            found.append([ANSWERS[row[column]] for column in answers])
    return np.array(rows), np.array(found, dtype=np.uint8)


@pytest.mark.parametrize("name", PACKED)
def test_the_tables_are_rows_of_the_whole_grids(name, whole_grids):
    rows, answers = packed(name)
    assert len(set(rows.tolist())) == len(rows) == {"cut_in": 1512, "following": 81}.get(name, 280)
    assert (whole_grids[name][rows] == answers).all()


@pytest.fixture(scope="module")
def whole_grids():
    """What JRC-FSM answers on its whole grids: 0 no crash; in cut-ins 1 from the side, 2 from behind; else 1."""
    return np.load(FOLDER / "jrc_grids.npz")


def test_the_command_gives_the_verdicts_of_the_whole_grids(tmp_path, whole_grids, monkeypatch):
    """All but 68 of 140,793; in the rest the other is exactly 0 or 0.5 m aside, or `fsm` brakes behind 0.95 g."""
    monkeypatch.setattr("interdrive.alks.case_figures", lambda *_: iter(()))  # 154 of them take most of the time
    result = CliRunner().invoke(main, ["alks", "all", "--driver-only", "--out", str(tmp_path / "out")])
    assert result.exit_code == 0, result.output
    rows = pq.read_table(tmp_path / "out" / "alks.parquet").to_pydict()
    kind, driver = np.array(rows["manoeuvre"]), np.array(rows["driver"])
    crash = np.array(rows["crash"])
    differ = {}
    for manoeuvre, names in (("cut_in", CUT_IN), ("cut_out", AHEAD), ("following", AHEAD)):
        for column, name in enumerate(name for name in ORDER if name in names):
            mine = crash[(kind == manoeuvre) & (driver == name)]
            theirs = whole_grids[manoeuvre][:, column] > 0
            assert len(mine) == len(theirs)
            if (mine != theirs).any():
                differ[manoeuvre, name] = int((mine != theirs).sum())
    assert len(crash) == 29_970 * 4 + 5_850 * 3 + 1_121 * 3
    assert differ == DIFFERENT
    assert sum(differ.values()) < 0.001 * len(crash)


def test_the_cut_ins_that_differ_have_sideways_speeds_at_which_rounding_decides(whole_grids):
    cases = grid("cut_in", "jrc").cases
    for column, name in enumerate(ORDER):
        found = cut_in(name, **cases)
        theirs = whole_grids["cut_in"][:, column]
        different = np.where(found.crash, np.where(found.is_beside, 1, 2), 0) != theirs
        assert different.mean() < 0.002, name
        assert set(np.round(cases["sideways"][different], 1).tolist()) <= {0.9, 1.0, 1.3, 1.6}, "m/s"


def test_the_leaders_of_all_cut_outs_end_as_in_the_whole_grid(whole_grids):
    for column, name in enumerate(name for name in ORDER if name in AHEAD):
        found = cut_out(name, **grid("cut_out", "jrc").cases)
        assert (found.leader_crash == whole_grids["cut_out_leader"][:, column].astype(bool)).all(), name


def test_all_safe_distances_are_those_of_ad_rss():
    rows = table("ad_rss_distances.csv")
    laws = {
        "same_direction": rss.same_direction,
        "opposite_direction": rss.opposite_direction,
        "lateral": rss.lateral,
    }
    parameters = {"intel": rss.INTEL, "jrc": rss.JRC}
    found = [
        laws[row["kind"]](float(row["first"]), float(row["second"]), parameters[row["parameters"]])[0] for row in rows
    ]
    assert len(rows) == 62
    assert np.abs(np.array(found) - numbers(rows, "distance_m")).max() < 1e-9


if __name__ == "__main__":
    written = {}
    for array in PACKED:
        at, said = packed(array, Path(sys.argv[1]))
        written[array] = said[np.argsort(at)]
        assert sorted(at.tolist()) == list(range(len(grid(PACKED[array][1], "jrc")))), array
    np.savez_compressed(FOLDER / "jrc_grids.npz", **written)
