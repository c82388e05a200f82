"""Whether the other vehicles of failures look recorded to a classifier."""

import numpy as np
import pytest
from braking_leader import AGENT, BRAKING
from click.testing import CliRunner

import interdrive as idr
from interdrive import InputError
from interdrive.cli import main
from interdrive.failure_search import HEAD, compared, failures
from interdrive.failure_search.disturbances import Disturbance, Error, erring_in
from interdrive.failure_search.likeness import Sample, likeness_of
from interdrive.failure_search.spaces import ERRORS
from interdrive.testing import Car, straight_road, world

FILES = 4


def sample(speed, n, seed):
    """Snippets of vehicles that drive at about a speed [m/s], two of each."""
    features = np.random.default_rng(seed).normal(0.0, 1.0, (n, 18))
    features[:, 0] += speed
    return Sample(features, np.repeat(np.arange(n // 2), 2))


def judged(speed_of_others):
    recorded = [sample(10.0, 100, seed) for seed in range(FILES)]
    driven = [sample(20.0, 100, FILES + seed) for seed in range(FILES)]
    return likeness_of(recorded, driven, [sample(speed_of_others, 40, 99)], [2])


def test_vehicles_that_drive_as_recorded_ones_look_recorded_and_those_that_drive_as_the_traffic_do_not():
    found = judged(10.0)
    assert (found.vehicles, found.recorded, found.simulated, found.files) == (20, 400, 400, FILES)
    assert found.share >= 0.9
    assert found.auc > 0.99
    assert found.driven < 0.05, "the traffic is 10 m/s faster than what was recorded"
    assert judged(20.0).alike == 0


def test_a_few_snippets_or_one_file_are_too_few_to_learn_from():
    with pytest.raises(InputError, match="40 recorded snippets of 2 files are too few to learn from"):
        likeness_of([sample(10.0, 20, 0)] * 2, [sample(20.0, 20, 1)] * 2, [], [])
    with pytest.raises(InputError, match="300 recorded snippets of 1 files"):
        likeness_of([sample(10.0, 300, 0)], [sample(20.0, 300, 1)], [], [])


@pytest.mark.parametrize("kind", ERRORS)
def test_the_words_of_a_failure_say_who_errs(kind):
    change = Disturbance(
        {102: 1.0}, {102: 1.1}, Error(kind, 103, 1.0, 4.0, 0.5), 40.0, drivers={102: {"time_gap": 1.0}}
    )
    assert erring_in(change.words()) == 103
    assert erring_in(Disturbance({102: 1.0}, {102: 1.1}, None, 40.0).words()) is None


@pytest.mark.long
def test_a_search_is_asked_for_its_vehicles_but_those_that_err(tmp_path):
    for name, speed in (("slow", 11.0), ("fast", 13.0)):
        cars = [Car(AGENT + place, 20.0 + 25.0 * place, velocity=speed) for place in range(10)]
        idr.write_scenario(world(straight_road(900.0), cars=cars, steps=240, name=name), tmp_path / f"{name}.xml")
    options = {"agent_id": AGENT, "predictor": "constant_velocity", "space": BRAKING, "shrink": False, "keep": 1}
    found = idr.search(tmp_path, "drivers:Straight", runs=12, out=tmp_path / "out", **options)
    assert found.failures
    result = CliRunner().invoke(main, ["search", "realism", str(tmp_path / "out"), str(tmp_path)])
    assert result.exit_code == 0, result.output
    (row,) = compared([tmp_path / "out"])
    # Who errs is no agent: it replays its recording and brakes.
    n_others = sum(len(one.drive.others) for one in failures(tmp_path / "out"))
    assert row.likeness is not None
    assert 0 < row.likeness.vehicles <= n_others
    assert row.likeness.auc > 0.6, "recorded vehicles keep their speed, those of idm their gap"
    assert dict(zip(HEAD, row.cells(), strict=True))["others look recorded"].endswith(f" of {row.likeness.vehicles}")
    assert f"of {row.likeness.vehicles} other vehicles" in " ".join(result.output.split())
    refused = CliRunner().invoke(main, ["search", "realism", str(tmp_path), str(tmp_path)])
    assert refused.exit_code == 2
