"""What the neural predictor is told, as arrays for training."""

import numpy as np
import pytest

from interdrive import InputError, _core
from interdrive.native_settings import RoadSettings
from interdrive.scenario.native import core_road, core_scenario
from interdrive.testing import Car, straight_road, world


def scenario(cars, steps=60, dt=0.1):
    built = world(straight_road(300.0, lanes=2), cars=cars, steps=steps, dt=dt)
    return core_scenario(built, core_road(built, RoadSettings()))


CARS = [Car(4, 20.0, 0.3, velocity=8.0), Car(9, 60.0, 3.5, velocity=12.0, first=10), Car(11, 150.0)]


def test_a_recorded_scene_holds_who_is_present_then_and_the_past_alone():
    scene = scenario(CARS).scene(30, history_steps=25)
    assert scene.time_step == 30
    assert scene.ids.tolist() == [4, 9, 11]
    assert scene.x.shape == (3, 26)
    assert scene.x[0, [0, -1]] == pytest.approx([24.0, 44.0])
    assert scene.valid[1].sum() == 21
    assert scenario(CARS).scene(5).ids.tolist() == [4, 11]


def test_a_time_step_that_is_not_recorded_is_refused():
    with pytest.raises(InputError, match=r"time step 61 is not recorded: the recording has 0 to 60"):
        scenario(CARS).scene(61)


def test_the_arrays_have_the_shapes_that_the_description_says():
    neural, inputs = _core.NEURAL, _core.NeuralInputs(scenario(CARS).scene(30))
    assert inputs.ids.tolist() == [4, 9, 11]
    n_paths = len(neural["slots"])
    assert inputs.agent.shape == (3, len(neural["agent"]))
    assert inputs.neighbours.shape == (3, 8, len(neural["neighbours"]))
    assert inputs.paths.shape == (3, n_paths, len(neural["paths"]))
    assert inputs.agent.dtype == inputs.paths.dtype == np.float32
    assert inputs.path_valid.sum(axis=1).tolist() == [3, 3, 3]
    assert inputs.standing.tolist() == [False, False, True]
    assert inputs.velocity.tolist() == [8.0, 12.0, 0.0]
    assert inputs.offset[0, 0] == pytest.approx(0.3)
    for table in ("agent", "neighbours", "paths"):
        names = [name for name, scale, mirror in neural[table] if scale > 0 and mirror in (-1.0, 1.0)]
        assert len(set(names)) == len(neural[table])
    assert sorted(neural["mirror_slots"]) == list(range(n_paths))
    assert [neural["slots"][i] for i in neural["mirror_slots"]][4:6] == ["right", "left"]


def test_targets_and_positions_are_inverse():
    inputs = _core.NeuralInputs(scenario(CARS).scene(30))
    time = np.array(_core.NEURAL["knots"])
    future = np.full((3, 6, 2), np.nan)
    future[0] = np.column_stack([44.0 + 8.0 * time, np.full(6, 0.3)])
    targets = inputs.targets(future)
    assert targets[0, 0, :, 0] == pytest.approx(8.0 * time, abs=1e-4)
    assert targets[0, 0, :, 1] == pytest.approx(0.3, abs=1e-4)
    assert np.isnan(targets[1:]).all()
    s, d = (targets[..., k].astype(float) for k in (0, 1))
    there = inputs.to_world(s, d)
    valid = inputs.path_valid[0]
    assert there[0, valid][..., :2] == pytest.approx(np.broadcast_to(future[0], (valid.sum(), 6, 2)), abs=1e-4)
    assert np.isnan(there[0, ~valid]).all()


def test_wrong_shapes_are_refused():
    inputs = _core.NeuralInputs(scenario(CARS).scene(30))
    with pytest.raises(InputError, match="future"):
        inputs.targets(np.zeros((2, 6, 2)))
    with pytest.raises(InputError, match="vehicles, paths, points"):
        inputs.to_world(np.zeros((3, 7)), np.zeros((3, 7)))
