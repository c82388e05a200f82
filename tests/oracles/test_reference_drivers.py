"""Reference drivers against JRC-FSM 01b05c2, run as a black box, and `ad-rss` 5.0.0: tables of what they answered."""

import csv
from pathlib import Path

import numpy as np
import pytest

from interdrive.reference_drivers import car_following, cut_in, cut_out, rss

FOLDER = Path(__file__).parent / "reference_drivers"
CUT_IN = {"cc": "CC_human_driver", "fsm": "FSM", "rss": "RSS", "r157": "Reg157"}
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
