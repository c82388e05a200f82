"""What predictors of users must do, what `check_predictor` finds, and what a run says about those that do not."""

import subprocess
import sys
import time

import numpy as np
import pytest

import interdrive as idr
from interdrive.testing import (
    Car,
    PredictorContractError,
    check_predictor,
    predictor_contract,
    problem,
    straight_road,
    world,
)


class Straight:
    """All participants keep speed and heading."""

    n_steps = 30

    def predict(self, scene):
        return idr.Predictions(**self.tables(scene))

    def tables(self, scene):
        n, steps = len(scene.ids), max(self.n_steps, round(3.0 / scene.dt))
        way = scene.velocity[:, -1, None] * np.arange(1, steps + 1) * scene.dt
        heading = scene.orientation[:, -1, None]
        shape = (n, 1, steps)
        return {
            "time_step": scene.time_step,
            "ids": scene.ids,
            "probability": np.ones((n, 1)),
            "x": (scene.x[:, -1, None] + way * np.cos(heading)).reshape(shape),
            "y": (scene.y[:, -1, None] + way * np.sin(heading)).reshape(shape),
            "orientation": np.broadcast_to(heading[:, None], shape),
            "velocity": np.broadcast_to(scene.velocity[:, -1, None, None], shape),
            "covariance": np.broadcast_to(np.eye(2), (*shape, 2, 2)),
            "valid": np.ones(shape, dtype=bool),
        }


class Changed(Straight):
    """`Straight`, but for what `change` does to its tables."""

    def predict(self, scene):
        tables = self.tables(scene)
        self.change(tables, scene)
        return idr.Predictions(**tables)


def changed(change):
    return type("Mine", (Changed,), {"change": lambda _, tables, scene: change(tables, scene)})


def later(tables, _scene):
    tables["time_step"] += 1


def short(tables, _scene):
    for name in ("x", "y", "orientation", "velocity", "covariance", "valid"):
        tables[name] = tables[name][:, :, :5]


def flat(tables, _scene):
    tables["x"] = tables["x"][:, 0]


def masked(tables, _scene):
    tables["y"] = np.ma.masked_greater(tables["y"], 0.0)


def complex_valued(tables, _scene):
    tables["x"] = tables["x"] + 0j


def endless(tables, _scene):
    shape = (*tables["x"].shape[:2], 10**9)
    tables["x"] = np.broadcast_to(tables["x"][:, :, :1], shape)


def half_precise(tables, _scene):
    tables["x"] = tables["x"].astype(np.float32)


def not_a_number(tables, _scene):
    tables["x"] = tables["x"] + np.nan


def singular(tables, _scene):
    tables["covariance"] = np.zeros_like(tables["covariance"])


def improbable(tables, _scene):
    tables["probability"] = 0.5 * tables["probability"]


def elsewhere(tables, _scene):
    tables["x"] = tables["x"] + 30.0


def of_strangers(tables, _scene):
    tables["ids"] = tables["ids"] + 5000


def random(tables, _scene):
    tables["x"] = tables["x"] + np.random.default_rng().normal(0.0, 0.1)


def slow(_tables, _scene):
    time.sleep(0.06)


def writes(_tables, scene):
    scene.x[:] = 0.0


def raises(_tables, _scene):
    raise RuntimeError("the battery is empty")


FINDINGS = [
    (later, "it returned predictions of time step 1"),
    (short, r"it predicts 5 steps of 0\.1 s, 30 are needed"),
    (flat, r"\(participants, modes, steps\) expected"),
    (masked, "y is a masked array; what is missing is said by `valid`"),
    (complex_valued, "TypeError: type mismatch: from=complex128, to=float64 while processing 'x'"),
    (endless, r"x has shape \[2, 1, 1000000000\], at most 10000000 values are allowed"),
    (half_precise, "TypeError: type mismatch: from=float32, to=float64 while processing 'x'"),
    (not_a_number, "has a valid step that is not a number"),
    (singular, "has a covariance that is not positive definite"),
    (improbable, "mode probabilities of participant"),
    (elsewhere, r"the first position is 3\d\.\d m away from the present"),
    (of_strangers, "it predicts participant 5001, which is not present"),
    (random, "made different predictions for the same scene"),
    (slow, r"predict took 0\.\d+ s for 2 participants, at most 0\.05 s are allowed"),
    (writes, "it writes into its scene, which is read-only"),
    (raises, "RuntimeError: the battery is empty"),
]


def test_a_predictor_that_keeps_the_contract_passes_in_every_world():
    longest = check_predictor(Straight)
    assert {"no participants", "time steps of 0.2 s", "a thousand cars"} <= set(longest)
    assert all(0 < seconds < 1 for seconds in longest.values())


@pytest.mark.parametrize("name", ["constant_velocity", "lane_following", "ground_truth", "neural"])
def test_native_predictors_keep_the_contract(name):
    check_predictor(name)


def test_a_call_may_take_longer_in_proportion_to_the_participants_beyond_a_hundred():
    def slow_in_crowds(_tables, scene):
        time.sleep(0.6 if len(scene.ids) == 1000 and scene.time_step == 0 else 0.0)

    check_predictor(changed(slow_in_crowds), seconds_max=0.3)
    with pytest.raises(
        PredictorContractError, match=r"^a thousand cars, .* 1000 participants, at most 0\.5 s are allowed"
    ):
        check_predictor(changed(slow_in_crowds), seconds_max=0.05)


def test_walenet_keeps_the_contract(published_walenet, monkeypatch):
    few = {name: scenario for name, scenario in predictor_contract._worlds().items() if name != "a thousand cars"}
    monkeypatch.setattr(predictor_contract, "_worlds", lambda: few)
    check_predictor("walenet")


@pytest.mark.parametrize(("change", "words"), FINDINGS)
def test_every_breach_of_the_contract_is_found_and_named(change, words):
    with pytest.raises(PredictorContractError, match=rf"^a straight road, time step \d+: .*{words}"):
        check_predictor(changed(change), seconds_max=0.05)


def test_what_has_no_predict_is_no_predictor():
    with pytest.raises(idr.InputError, match="no method predict"):
        check_predictor(object)


def scenario():
    return world(
        straight_road(200.0),
        cars=[Car(7, 60.0, velocity=8.0)],
        problems=[problem(100, 10.0, goal=(120.0, 0.0), time_step=(0, 150))],
    )


def of_nothing(self, scene):
    return None


@pytest.mark.parametrize(
    ("change", "words"),
    [
        *(
            finding
            for finding in FINDINGS
            if finding[0] in (later, flat, masked, complex_valued, endless, not_a_number, singular, improbable, raises)
        )
    ],
)
def test_garbage_of_a_predictor_ends_the_run_with_its_name_and_the_time_step(change, words):
    name = r"predictor test_predictor_contract:Mine, time step 0: .*"
    with pytest.raises(idr.PredictorError, match=name + words):
        idr.simulate(scenario(), predictor=changed(change))


def test_a_predictor_that_returns_nothing_ends_the_run_with_its_name_and_the_time_step():
    nothing = type("Mine", (), {"predict": of_nothing})
    with pytest.raises(idr.PredictorError, match=r"time step 0: it returned NoneType, interdrive\.Predictions"):
        idr.simulate(scenario(), predictor=nothing)


def test_who_a_predictor_leaves_out_goes_straight_on():
    def no_participants(tables, _scene):
        for name in tables:
            if name != "time_step":
                tables[name] = tables[name][:0]

    without, straight = (
        idr.simulate(scenario(), agents=[100], predictor=p) for p in (changed(no_participants), "constant_velocity")
    )
    assert without.outcomes.outcome == straight.outcomes.outcome == ("goal_reached",)


def test_in_the_command_line_garbage_of_a_predictor_is_one_line(tmp_path):
    (tmp_path / "mine.py").write_text(
        "class Broken:\n    def predict(self, scene):\n        raise ValueError('no idea\\nat all')\n"
    )
    for command in (["run", "t_junction", "--predictor"], ["predict-eval", "t_junction", "--predictors"]):
        done = subprocess.run(
            [sys.executable, "-m", "interdrive", *command, "mine:Broken", "--out", "found"],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=False,
            timeout=120,
        )
        assert done.returncode == 2
        assert done.stderr.count("\n") == 1
        assert "predictor mine:Broken, time step 0: mine.py:3 in predict: ValueError: no idea at all" in done.stderr
        assert not (tmp_path / "found").exists()
