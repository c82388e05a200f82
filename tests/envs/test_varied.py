"""Scenarios to learn from: every seed is another junction, and vehicles that keep their speed there hit others."""

import importlib.util
import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from interdrive import simulate
from interdrive.files import open_scenario

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def compare():
    spec = importlib.util.spec_from_file_location("compare", ROOT / "examples/rl/compare.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def varied():
    sys.path.insert(0, str(ROOT / "scenarios"))
    try:
        yield importlib.import_module("varied")
    finally:
        sys.path.remove(str(ROOT / "scenarios"))


@pytest.fixture(scope="module")
def made(varied, tmp_path_factory):
    folder = tmp_path_factory.mktemp("varied")
    varied.main([str(folder), "--number", "3", "--seed", "100"])
    return sorted(folder.glob("*.xml"))


def test_a_seed_is_a_scenario_and_another_one_another(made, varied, tmp_path):
    varied.main([str(tmp_path), "--number", "1", "--seed", "100"])
    texts = [path.read_text(encoding="utf-8") for path in made]
    assert (tmp_path / made[0].name).read_text(encoding="utf-8") == texts[0]
    assert len(set(texts)) == len(made) == 3


def test_roads_bend_and_their_lanes_differ_in_width(made):
    widths, turns = [], []
    for path in made:
        lanelets = open_scenario(path).lanelets
        left, right = lanelets.left[0], lanelets.right[0]
        widths.append(np.hypot(*(left[0] - right[0])))
        ends = np.arctan2(*np.diff(left[[0, 1, -2, -1]], axis=0)[[0, 2]].T)
        turns.append(abs(np.diff(ends)[0]))
    assert np.ptp(widths) > 0.05
    assert max(turns) > np.deg2rad(10)
    assert 3.0 <= min(widths) <= max(widths) <= 4.0


def test_vehicles_that_keep_their_speed_hit_others_where_planners_do_not(made, compare):
    held, planned = Counter(), Counter()
    for path in made:
        held += compare.driven(path, compare.hold_speed)
        run = simulate(path, agents="all", planner="idm", predictor="lane_following")
        planned.update(run.outcomes.outcome)
    assert held.total() == planned.total() >= 12
    assert held["collision"] >= 0.2 * held.total()
    assert planned["collision"] == 0


def test_impossible_numbers_are_refused(varied, tmp_path, capsys):
    with pytest.raises(SystemExit) as refused:
        varied.main([str(tmp_path), "--number", "0"])
    assert refused.value.code == 2
    assert "--number must be at least 1" in capsys.readouterr().err
