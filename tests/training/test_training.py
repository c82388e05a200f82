"""The split of the training data, and the shipped weights against what torch computed with them."""

import csv
import hashlib
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from interdrive import _core, evaluate_predictors, simulate
from interdrive.files import read_scenario, shipped_scenario
from interdrive.prediction_evaluation.tables import ALL, ANY, measures_table
from interdrive.storage.weights import read_weights

ROOT = Path(__file__).resolve().parents[2]
WEIGHTS = ROOT / "python" / "interdrive" / "predictors" / "neural.safetensors"

split = pytest.importorskip("training.split", reason="training/ is part of the repository, not of the package")


@pytest.fixture(scope="module")
def places():
    return split.read_places()


@pytest.fixture(scope="module")
def data_list():
    """The files that the shipped weights were made with, as the log of the training states them."""
    with (ROOT / "training" / "log" / "files.csv").open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


def test_every_scenario_file_shows_exactly_one_place(places, scenarios_folder):
    found = [split.place_of(path.stem, places) for path in scenarios_folder.glob("*/*.xml")]
    assert len(found) > 50  # it raises for none and for several
    assert len({place.name for place in found}) > 20


def test_the_weights_were_made_with_the_split_that_is_stated(places, data_list):
    assert len(data_list) > 200
    for line in data_list:
        place = split.place_of(line["file"], places)
        assert (place.name, place.part) == (line["place"], line["part"]), line["file"]


def test_no_file_of_a_validation_place_is_driven_and_no_place_often(places, data_list):
    driven = pytest.importorskip("training.driven").files_to_drive(
        [Path(f"{x['file']}.xml") for x in data_list], places
    )
    of_place = Counter(split.place_of(name, places).name for name in driven)
    assert {split.place_of(name, places).part for name in driven} == set(split.FOLDS)
    assert max(of_place.values()) == 8
    assert set(driven.values()) == {"frenet", "idm_mobil"}


def test_driven_traffic_is_what_the_planner_made_of_the_scenario():
    driven = pytest.importorskip("training.driven")
    scenario = read_scenario(shipped_scenario("lane_merge"))
    found, agents = driven.driven_traffic(scenario, "idm_mobil")
    run = simulate(scenario, planner="idm_mobil", predictor="lane_following", threads=1)
    assert agents.tolist() == sorted(run.outcomes.agent_id.tolist())
    assert np.array_equal(found.obstacles.x, run.states.x, equal_nan=True)
    there = np.isin(found.obstacles.ids, agents)
    assert found.obstacles.valid[there].any(axis=1).all()


def test_every_category_has_places_for_validation(places, data_list):
    used = {line["place"] for line in data_list}
    kept = {place.category for place in places if place.part == "validation" and place.name in used}
    assert kept >= {"highway", "intersection", "urban", "junction"}


def test_maps_with_the_same_lanelets_are_on_one_side_of_the_split(places, recorded_scenarios):
    """Lanelets agree if their left bounds do, up to translation; lanelets of less than 30 m could agree by chance."""
    sides = {}
    for name, scenario in recorded_scenarios.items():
        if isinstance(scenario, Exception):
            continue
        place = split.place_of(Path(name).stem, places)
        for bound in scenario.lanelets.left:
            chord = bound[-1, :2] - bound[0, :2]
            steps = np.linalg.norm(np.diff(bound[:, :2], axis=0), axis=1)
            if steps.sum() < 30.0 or place.part == "none" or steps.sum() - np.linalg.norm(chord) < 0.5:
                continue
            key = (len(bound), *np.rint(chord * 10).astype(int), round(10 * steps.sum()), round(10 * steps[0]))
            sides.setdefault(key, {})[place.part == "validation"] = name
    both = [names for names in sides.values() if len(names) == 2]
    assert not both, f"on both sides: {both[0]}"


def test_a_file_of_no_place_and_one_of_two_places_are_refused(places):
    with pytest.raises(ValueError, match="NOWHERE-1_1_T-1 belongs to no place"):
        split.place_of("NOWHERE-1_1_T-1", places)
    with pytest.raises(ValueError, match=r"belongs to .* and "):
        split.place_of("USA_US101-1_1_T-1", (*places, places[0]))


def test_the_forward_pass_says_what_torch_said():
    stored = np.load(ROOT / "tests" / "predictors" / "neural_forward.npz")
    network = _core.NeuralNetwork(read_weights(WEIGHTS).tensors)
    inputs = [stored[name] for name in ("agent", "neighbours", "paths", "path_valid")]
    raw = np.asarray(network.forward(*inputs)).reshape(stored["raw"].shape)
    there = stored["path_valid"]
    assert there.any(axis=0).sum() >= 4, "the fixture has vehicles with several paths"
    assert raw[there] == pytest.approx(stored["raw"][there], rel=1e-4, abs=1e-4)


def test_the_weights_are_small_and_say_how_they_were_made():
    metadata = read_weights(WEIGHTS).metadata
    assert WEIGHTS.stat().st_size < 2_000_000
    assert metadata["feature_version"] == str(_core.NEURAL["version"])
    assert {"seed", "epochs", "data", "sizes"} <= set(metadata)


def test_the_log_is_that_of_the_shipped_weights(data_list):
    weights = read_weights(WEIGHTS)
    summary = (ROOT / "training" / "log" / "summary.txt").read_text(encoding="utf-8")
    for name in ("seed", "epochs", "data", "files"):
        assert f"{name}: {weights.metadata[name]}\n" in summary
    for name in ("s", "d", "evenness_s", "evenness_d"):
        values = ", ".join(str(round(float(value), 4)) for value in weights.tensors[f"calibration.{name}"])
        assert f"{name}=({values})" in summary
    pairs = [round(float(value), 4) for value in weights.tensors["decode.tail"]]
    assert f"tail=Tail(probability=({pairs[0]}, {pairs[2]}), factor=({pairs[1]}, {pairs[3]}))" in summary
    lines = "".join(f"{line['file']}.xml {line['sha256']}\n" for line in data_list)
    assert hashlib.sha256(lines.encode()).hexdigest() == weights.metadata["data"]


@pytest.mark.recorded
def test_at_places_that_it_was_not_trained_at_neural_is_nearer_than_lane_following(scenarios_folder):
    found = evaluate_predictors(scenarios_folder, ["lane_following", "neural"], every=20, split=split.SPLIT)
    rows = {
        row["predictor"]: row
        for row in measures_table(found).to_pylist()
        if (row["category"], row["traffic"]) == (ALL, ANY)
    }
    neural, lanes = rows["neural"], rows["lane_following"]
    assert neural["samples_3"] > 500
    assert neural["fde_3"] < 0.9 * lanes["fde_3"]
    assert neural["fde_best_3"] < 0.7 * lanes["fde_best_3"]
    assert neural["nll_median_3"] < lanes["nll_median_3"]
    assert 0.85 < neural["region_90_3"] < 0.97
    assert 0.97 < neural["region_99_3"] < 1.0
    assert neural["nll_3"] < lanes["nll_3"]
    assert neural["stays_samples"] > 50
    assert neural["stays_p95"] < 0.2
