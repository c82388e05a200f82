"""The total of the score against a panel: golden values of another program, and properties of random drives."""

from __future__ import annotations

import ast
import csv
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from interdrive.errors import InputError
from interdrive.scoring.settings import PanelWeights
from interdrive.scoring.total import GATES, Facts, total

GOLDEN = Path(__file__).parent / "golden" / "scores.csv"
#: What the golden program calls the same facts.
NAMES = {"T": "duration", "D": "way", "free": "free_flow"}
BASE = {
    "T": 10.0, "D": 80.0, "free": 7.0, "panel_times": (8.0, 9.0, 9.5), "in_time": 0, "arrived": 1, "panel_arrived": 1,
    "gates": {}, "ttc": 1, "comfort": 1, "lost": 0.0, "panel_lost": (0.0, 0.0, 0.0), "forced": 0,
    "panel_gates": (), "panel_ttc": (1,), "panel_comfort": (1,),
}  # fmt: skip


def golden():
    with GOLDEN.open(newline="") as file:
        return [pytest.param(row, id=row["case"]) for row in csv.DictReader(file)]


def changed(text):
    """The changed facts: literals, but for inf, nan, and a product of a tuple."""
    names = {"inf": math.inf, "nan": math.nan}
    tree = ast.parse(text, mode="eval")
    assert {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)} <= set(names)
    assert not any(isinstance(node, ast.Call) for node in ast.walk(tree))
    return eval(compile(tree, "golden", "eval"), {"__builtins__": {}}, names)


@pytest.mark.parametrize("row", golden())
def test_scores_are_those_of_the_definition(row):
    facts = {**BASE, **changed(row["changed"])}
    found = total(Facts(**{NAMES.get(name, name): value for name, value in facts.items()}))
    for name in ("score", "pace", "arrival", "gate", "hindrance", "quality"):
        assert getattr(found, name) == pytest.approx(float(row[name]), abs=1e-9, nan_ok=True), name


def drawn(random):
    """Facts of a random drive."""
    n = int(random.integers(0, 5))

    def gates():
        return {
            str(name): float(random.choice([0.0, 0.5, 1.0])) for name in random.choice(GATES, random.integers(0, 4))
        }

    def truth():
        return float(random.choice([0.0, 1.0, math.nan]))

    arrived = bool(random.integers(0, 2))
    return Facts(
        duration=float(random.uniform(0.1, 60.0)),
        way=float(random.uniform(0.0, 300.0)),
        free_flow=float(random.uniform(0.0, 30.0)),
        in_time=arrived and bool(random.integers(0, 2)),
        arrived=arrived,
        gates=gates(),
        ttc=truth(),
        comfort=truth(),
        lost=float(random.choice([math.nan, random.uniform(0.0, 20.0)])),
        forced=bool(random.integers(0, 2)),
        panel_times=tuple(float(random.choice([math.inf, random.uniform(0.1, 60.0)])) for _ in range(n)),
        panel_arrived=n > 0 and bool(random.integers(0, 2)),
        panel_gates=tuple(gates() for _ in range(n)),
        panel_ttc=tuple(truth() for _ in range(n)),
        panel_comfort=tuple(truth() for _ in range(n)),
        panel_lost=tuple(float(random.uniform(0.0, 20.0)) for _ in range(n)),
        panel_way=float(random.uniform(0.0, 300.0)) if n else math.nan,
    )


@pytest.mark.long
def test_whatever_gets_worse_never_raises_the_score():
    random = np.random.default_rng(20261128)
    for _ in range(5000):
        facts = drawn(random)
        found = total(facts)
        assert 0.0 <= found.pace <= 1.0
        assert 0.0 <= found.score <= 1.0
        assert found.arrival == 1.0 or found.score <= 0.5
        assert found.cls <= 1.0 and found.epdms <= 1.0
        name = str(random.choice(GATES))
        worse = (
            replace(facts, duration=facts.duration * random.uniform(1.0, 3.0)),
            replace(facts, gates={**facts.gates, name: 0.5 * facts.gates.get(name, 1.0)}),
            replace(facts, forced=True),
            replace(facts, lost=facts.lost + random.uniform(0.0, 5.0)),
            replace(facts, in_time=False),
        )
        for change in worse:
            assert total(change).score <= found.score + 1e-12, (facts, change)


def test_a_broken_planner_gets_nothing_even_if_the_whole_panel_breaks():
    facts = Facts(10.0, 80.0, 7.0, False, True, gates={"alive": 0.0}, panel_gates=({"alive": 0.0},) * 3)
    assert total(facts).score == 0.0


def test_the_forms_of_others_stand_beside_it():
    facts = Facts(10.0, 40.0, 7.0, False, False, {"speed": 0.5, "red_light": 0.0}, 1.0, 0.0, panel_way=80.0)
    found = total(facts)
    assert found.cls == pytest.approx((5 * 0.5 + 5 + 4 * 0.5) / 16)
    assert found.epdms == 0.0
    assert total(replace(facts, gates={})).epdms == pytest.approx((5 * 0.5 + 5) / 12)
    assert total(replace(facts, way=10.0)).cls == 0.0, "less than a fifth of the way of others"


def test_weights_may_not_all_be_zero():
    with pytest.raises(InputError, match="must not all be 0"):
        PanelWeights(0.0, 0.0, 0.0)
