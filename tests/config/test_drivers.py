"""Populations of drivers: what agents draw, files, and what planners make of them."""

import json

import numpy as np
import pytest

import interdrive as idr
from interdrive import InputError
from interdrive.config.drivers import PARAMETERS, POPULATIONS, Distribution, Drivers, read_drivers
from interdrive.testing import Car, straight_road, world

FILE = """
format = 1
correlation = [["time_gap", "acceleration", -0.5]]
[parameters.time_gap]
transform = "log"
bounds = [0.6, 3.0]
median = 1.2
sd = 0.3
[parameters.acceleration]
transform = "logit"
bounds = [0.5, 3.0]
median = 1.0
sd = 0.4
[truck.acceleration]
median = 0.6
bounds = [0.5, 1.0]
"""


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(FILE)
    return str(path)


@pytest.fixture(scope="module")
def road():
    return world(straight_road(400.0), cars=[Car(11 + i, 30.0 * i, 0.0, 10.0) for i in range(4)])


def test_a_draw_depends_on_seed_and_id_alone():
    one = Drivers("one", {"time_gap": Distribution(1.2, 0.3, "log", 0.6, 3.0)})
    assert one.drawn(0, 10450)["time_gap"] == pytest.approx(1.109421, abs=1e-6)
    more = Drivers("more", {"acceleration": Distribution(1.0, 0.3, "identity", 0.5, 3.0), **one.parameters})
    assert more.drawn(0, 10450)["time_gap"] == one.drawn(0, 10450)["time_gap"]
    assert one.drawn(1, 10450) != one.drawn(0, 10450) != one.drawn(0, 10451)


@pytest.mark.parametrize("name", POPULATIONS)
def test_what_is_drawn_lies_around_the_medians_and_within_bounds(name):
    population = POPULATIONS[name]
    drawn = [population.drawn(7, agent) for agent in range(400)]
    for key, one in population.parameters.items():
        values = np.array([own[key] for own in drawn])
        assert np.median(values) == pytest.approx(one.median, rel=0.1)
        assert PARAMETERS[key][0] <= values.min() <= values.max() <= PARAMETERS[key][1]


def _share_below(source, name, value):
    """Of the drivers of a population, the share that draw less."""
    return float(np.mean([source.drawn(3, agent)[name] < value for agent in range(4000)]))


@pytest.mark.parametrize(("name", "roomy"), [("calm", 0.85), ("brisk", 0.15)])
def test_calm_and_brisk_drivers_are_at_opposite_ends_of_the_calibrated_ones(name, roomy):
    source, found = POPULATIONS["calibrated"], POPULATIONS[name]
    for key in ("time_gap", "minimum_gap"):
        assert _share_below(source, key, found.parameters[key].median) == pytest.approx(roomy, abs=0.02), key
    for key in ("acceleration", "deceleration", "desired_factor"):
        assert _share_below(source, key, found.parameters[key].median) == pytest.approx(1.0 - roomy, abs=0.02), key
    assert found.constants == source.constants
    assert found.fitted_on == source.fitted_on


def test_drivers_of_the_house_are_around_the_defaults_of_idm_and_waver():
    found = POPULATIONS["house"]
    medians = {name: one.median for name, one in found.parameters.items()}
    usual = idr.Idm()
    assert medians == {
        "time_gap": usual.time_gap,
        "minimum_gap": usual.minimum_gap,
        "acceleration": usual.acceleration,
        "deceleration": usual.deceleration,
        "desired_factor": 1.0,
    }
    assert {name: one.sd for name, one in found.parameters.items()} == {
        **dict.fromkeys(medians, 0.25),
        "desired_factor": 0.1,
    }
    assert found.constants == {"noise": 0.2, "noise_length": 1.5}
    assert found.fitted_on == ()


def test_the_calibrated_population_says_where_it_is_from():
    found = POPULATIONS["calibrated"]
    assert found.fitted_on == ("DEU_MONAEast", "USA_US101")
    assert found.planner == "idm"
    assert set(found.provenance["held_out"]).isdisjoint(found.fitted_on)
    assert "keep terms of their own" in found.provenance["licence"]
    assert {"noise", "time_gap_kept", "lateral_kept", "lateral_way"} <= set(found.constants)


def test_a_file_has_transforms_correlations_and_kinds(file):
    found = read_drivers(file)
    drawn = [found.drawn(0, agent) for agent in range(500)]
    gap, acceleration = (np.array([own[key] for own in drawn]) for key in ("time_gap", "acceleration"))
    assert np.corrcoef(np.log(gap), acceleration)[0, 1] < -0.3
    assert found.drawn(0, 3, "truck")["acceleration"] == pytest.approx(0.6)
    assert found.drawn(0, 3, "truck")["time_gap"] == found.drawn(0, 3)["time_gap"]


def test_agents_have_their_own_settings_which_the_run_stores_plain(road, file, tmp_path):
    run = idr.simulate(road, planner=f"idm,minimum_gap=3,drivers={file}", seed=5)
    planners = run.settings["planner"]
    own = read_drivers(file).drawn(5, 12)
    assert planners["12"]["time_gap"] == own["time_gap"]
    assert planners["12"]["minimum_gap"] == 3.0
    assert len({planner["time_gap"] for planner in planners.values()}) == 4
    run.save(tmp_path / "run")
    assert "mine.toml" not in json.dumps(json.loads((tmp_path / "run" / "run.json").read_text())["settings"])
    again = idr.simulate(road, planner=planners)
    assert again.digest == run.digest


def test_a_population_without_spread_is_the_planner_with_these_settings(road, tmp_path):
    path = tmp_path / "alike.toml"
    path.write_text("format = 1\n[parameters.time_gap]\nmedian = 1.4\n")
    drawn = idr.simulate(road, planner=f"idm,drivers={path}")
    assert drawn.digest == idr.simulate(road, planner="idm,time_gap=1.4").digest


@pytest.mark.parametrize("planner", ["idm", "idm_mobil", "velocity_adjusting", "rollout", "frenet"])
@pytest.mark.parametrize("name", ["calm", "calibrated"])
def test_native_planners_that_follow_have_drivers(road, planner, name):
    run = idr.simulate(road, planner=f"{planner},drivers={name}", settings={"step.max_steps": 3})
    assert len({json.dumps(one) for one in run.settings["planner"].values()}) == 4


def test_seeds_draw_other_drivers_and_agents_left_out_change_nothing(road):
    planners = [idr.simulate(road, planner="idm,drivers=house", seed=seed).settings["planner"] for seed in (0, 1)]
    assert planners[0]["12"] != planners[1]["12"]
    alone = idr.simulate(road, agents=[12], planner="idm,drivers=house", seed=0)
    assert alone.settings["planner"] == planners[0]["12"]


TEMPER = """
format = 1
[parameters.desired_factor]
transform = "identity"
bounds = [0.7, 1.4]
median = 1.0
sd = 0.2
[parameters.free_weight]
transform = "identity"
bounds = [0.0, 1.0]
median = 0.5
sd = 0.2
"""


def test_drivers_of_goals_without_time_want_other_speeds_and_their_runs_can_be_repeated(road, tmp_path):
    path = tmp_path / "temper.toml"
    path.write_text(TEMPER)
    place = {"goal.information": "turns"}
    run = idr.simulate(road, planner=f"idm,drivers={path}", settings=place, seed=2)
    wanted = {agent.id: agent.goal[0].velocity[1] / 2.0 for agent in run.agents}
    factors = {number: read_drivers(str(path)).drawn(2, number)["desired_factor"] for number in wanted}
    assert len(set(factors.values())) == 4
    # All start with 10 m/s.
    assert wanted == pytest.approx({number: 10.0 * factor for number, factor in factors.items()})
    assert run.settings["planner"]["12"]["driver.desired_factor"] == factors[12]
    again = idr.simulate(road, planner=run.settings["planner"], settings=place)
    assert again.digest == run.digest
    run.save(tmp_path / "run")
    assert idr.load(tmp_path / "run").settings["planner"] == run.settings["planner"]
    assert run.digest != idr.simulate(road, planner="idm", settings=place).digest


def test_goals_with_a_time_leave_drivers_no_other_speed(road, tmp_path):
    path = tmp_path / "temper.toml"
    path.write_text(TEMPER)
    assert idr.simulate(road, planner=f"idm,drivers={path}").digest == idr.simulate(road, planner="idm").digest


@pytest.mark.parametrize("planner", ["idm", "idm_mobil"])
def test_drivers_waver_each_in_its_own_way_and_their_runs_can_be_repeated(road, planner, tmp_path):
    path = tmp_path / "wavering.toml"
    path.write_text("format = 1\n[driver]\nnoise = 0.3\nnoise_length = 2.0\n")
    run = idr.simulate(road, planner=f"{planner},drivers={path}", seed=4)
    own = run.settings["planner"]
    assert {one["noise"] for one in own.values()} == {0.3}
    assert len({one["noise_seed"] for one in own.values()}) == 4
    assert run.digest != idr.simulate(road, planner=planner, seed=4).digest
    assert idr.simulate(road, planner=own).digest == run.digest
    assert idr.simulate(road, planner=own, threads=2).digest == run.digest
    assert run.outcomes.outcome.count("collision") == 0


def test_planners_that_do_not_waver_take_the_rest_of_a_population(road, tmp_path):
    path = tmp_path / "wavering.toml"
    path.write_text("format = 1\n[driver]\nnoise = 0.3\n[parameters.time_gap]\nmedian = 1.4\n")
    assert read_drivers(str(path)).settings("rollout", 0, 12) == {"comfort.time_gap": 1.4}


def test_a_file_may_say_that_drivers_stay_where_they_start_in_their_lane(tmp_path):
    path = tmp_path / "start.toml"
    path.write_text('format = 1\n[driver]\nlateral_offset = "start"\n')
    assert read_drivers(str(path)).constants == {"lateral_kept": 1.0}


def test_lengths_without_the_noise_that_they_belong_to_are_no_settings(tmp_path):
    path = tmp_path / "calm.toml"
    path.write_text("format = 1\n[driver]\nnoise_length = 2.5\nlateral_length = 3.0\nlateral_way = 30.0\n")
    assert read_drivers(str(path)).constants == {}
    path.write_text("format = 1\n[driver]\nlateral_noise = 0.2\nlateral_way = 30.0\n")
    assert read_drivers(str(path)).constants == {"lateral_noise": 0.2, "lateral_length": 2.0, "lateral_way": 30.0}


def _moved_aside(speed, words):
    """How fast a car of constant speed gets aside within 6 s, at most [m/s]."""
    road = world(straight_road(300.0), cars=[Car(11, 0.0, 0.0, speed)], steps=60)
    place = {"goal.information": "turns"}
    run = idr.simulate(road, planner=f"idm,lateral_noise=0.25,noise_seed=5,{words}", settings=place)
    y = run.states.y[0][np.isfinite(run.states.y[0])]
    return float(np.abs(np.diff(y)).max() / 0.1)


def test_a_place_that_changes_with_the_way_is_left_more_slowly_by_who_is_slow():
    with_time = [_moved_aside(speed, "lateral_length=1.8") for speed in (3.0, 15.0)]
    with_way = [_moved_aside(speed, "lateral_way=25") for speed in (3.0, 15.0)]
    assert with_time[0] > 0.7 * with_time[1]
    assert with_way[0] < 0.5 * with_way[1]
    assert with_way[0] < 0.5 * with_time[0]


def test_who_follows_in_the_improved_model_keeps_its_time_gap_near_its_desired_speed():
    road = world(straight_road(3000.0), cars=[Car(11, 0.0, 0.0, 19.0), Car(12, 60.0, 0.0, 19.0)], steps=600)
    settings = {"goal.information": "turns", "step.max_steps": 600}

    def gap(improved):
        planner = {11: f"idm,time_gap=1.5,improved={improved},driver.desired_factor=1.1", "default": "recorded"}
        run = idr.simulate(road, planner=planner, settings=settings)
        x = run.states.x[:, -1] if np.isfinite(run.states.x[:, -1]).all() else run.states.x[:, -2]
        return float(x[1] - x[0] - run.states.length[0])

    kept = 2.0 + 1.5 * 19.0
    assert gap(1.0) == pytest.approx(kept, abs=0.6), "m"
    assert gap(0.0) > kept + 5.0, "m"


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ('lateral_offset = "end"', r"driver.lateral_offset: must be a number from -2 to 2, is 'end'"),
        (
            'lateral_offset = "start"\nlateral_kept = 0.5',
            r"driver.lateral_offset: is start, which lateral_kept says, too",
        ),
        ("noise = 9.0", r"driver.noise: must be a number from 0 to 5, is 9.0"),
        ("noise_length = 0", r"driver.noise_length: must be a number from 0.01 to 60, is 0"),
        ("mood = 1", r"driver.mood: is not known; there are improved, noise, noise_length"),
    ],
)
def test_noise_that_is_none_is_refused(table, words, tmp_path):
    path = tmp_path / "bad.toml"
    path.write_text(f"format = 1\n[driver]\n{table}\n")
    with pytest.raises(InputError, match=words):
        read_drivers(str(path))


def test_a_single_agent_may_be_told_what_its_driver_wants(road):
    place = {"goal.information": "turns"}
    run = idr.simulate(road, planner={12: "idm,driver.desired_factor=1.3", "default": "idm"}, settings=place)
    wanted = {agent.id: agent.goal[0].velocity[1] / 2.0 for agent in run.agents}
    assert wanted == pytest.approx({11: 10.0, 12: 13.0, 13: 10.0, 14: 10.0}), "m/s"


def test_a_batch_runs_with_drivers(road, tmp_path):
    path = tmp_path / "road.xml"
    idr.write_scenario(road, path)
    idr.batch([path], tmp_path / "batch", planner=["idm", "idm,drivers=house", "idm,drivers=calibrated"], workers=1)
    rows = idr.read_batch(tmp_path / "batch").to_pylist()
    digests = {row["planner"]: row["digest"] for row in rows}
    assert set(digests) == {"idm", "idm,drivers=house", "idm,drivers=calibrated"}
    assert len(set(digests.values())) == 3
    assert all(row["status"] == "finished" for row in rows)


@pytest.mark.parametrize(
    ("planner", "words"),
    [
        ("recorded,drivers=house", "planner recorded: drivers=house: it has none; idm, idm_mobil"),
        ("idm,drivers=hose", "there is no population 'hose'; did you mean house?"),
        ("idm,drivers=none.toml", "drivers none.toml: cannot be read"),
        ("idm,driver.desired_factor=3", "driver.desired_factor: must be a number from 0.7 to 1.4, is 3"),
        ("idm,driver.mood=1", "driver.mood: is not known; there are desired_factor, free_weight"),
    ],
)
def test_planners_and_names_that_do_not_fit_are_refused(road, planner, words):
    with pytest.raises(InputError, match=words) as caught:
        idr.simulate(road, planner=planner)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("format = 1", "format = 2"), "format: must be 1, is 2"),
        (("[0.6, 3.0]", "[3.0, 0.6]"), "time_gap: bounds must ascend within 0.6 and 3, are 3 and 0.6"),
        (("median = 1.2", "median = 4.0"), "time_gap: the median 4 must be between"),
        (("parameters.time_gap", "parameters.time_gab"), "time_gab: is no parameter of drivers; did you mean time_gap"),
        (("-0.5", "1.5"), "correlation: two parameters and a number between -1 and 1"),
        (('"log"', '"cube"'), "time_gap: transform must be log, logit, identity"),
        (("sd = 0.3", "sd = -0.3"), "time_gap: sd must be at least 0"),
        (("format = 1", "format = 1\nmean = 2"), "mean: is not known here"),
    ],
)
def test_files_that_cannot_be_used_are_refused_in_one_line(tmp_path, change, words):
    path = tmp_path / "wrong.toml"
    path.write_text(FILE.replace(*change))
    with pytest.raises(InputError, match=words) as caught:
        read_drivers(str(path))
    assert "\n" not in str(caught.value)


def test_correlations_that_contradict_each_other_are_refused(tmp_path):
    path = tmp_path / "wrong.toml"
    pairs = [["time_gap", "acceleration", 0.9], ["acceleration", "deceleration", 0.9]]
    pairs.append(["time_gap", "deceleration", -0.9])
    path.write_text(FILE.replace('[["time_gap", "acceleration", -0.5]]', json.dumps(pairs)))
    with pytest.raises(InputError) as caught:
        read_drivers(str(path))
    assert str(caught.value) == f"drivers {path}: correlation: the matrix is not positive definite"


def _offsets(road, table, tmp_path, planner="idm", **options):
    path = tmp_path / "beside.toml"
    path.write_text(f"format = 1\n[driver]\n{table}\n")
    run = idr.simulate(road, planner=f"{planner},drivers={path}", **options)
    assert run.outcomes.outcome.count("collision") == 0
    return run.states.y, run


@pytest.mark.parametrize("planner", ["idm", "idm_mobil"])
def test_drivers_keep_the_side_of_the_lane_on_which_they_start(planner, tmp_path):
    cars = [Car(11 + i, 40.0 * i, offset, 10.0) for i, offset in enumerate((0.5, -0.4, 0.0))]
    road = world(straight_road(400.0), cars=cars)
    y, _ = _offsets(road, "lateral_kept = 1.0", tmp_path, planner)
    assert y[:, 35:55] == pytest.approx(np.array([[0.5], [-0.4], [0.0]]) * np.ones(20), abs=0.02)
    y, _ = _offsets(road, "lateral_kept = 0.5\nlateral_offset = 0.1", tmp_path, planner)
    assert y[:, 35:55] == pytest.approx(np.array([[0.35], [-0.1], [0.1]]) * np.ones(20), abs=0.02)
    y, _ = _offsets(road, "lateral_offset = 2.0", tmp_path, planner)
    width = idr.simulate(road, planner=planner).states.width[0]
    assert y[:, 35:55] == pytest.approx(0.5 * (3.5 - width) - 0.2, abs=0.02), "it stays in its lane"


@pytest.mark.parametrize("planner", ["idm", "idm_mobil"])
def test_drivers_move_within_their_lane_each_in_its_own_way(road, planner, tmp_path):
    y, run = _offsets(road, "lateral_noise = 0.3\nlateral_length = 1.5", tmp_path, planner)
    assert 0.05 < np.nanstd(y[:, 30:]) < 0.4
    assert np.nanmax(np.abs(y)) < 1.0
    assert abs(np.corrcoef(y[0, 30:150], y[1, 30:150])[0, 1]) < 0.95
    assert idr.simulate(road, planner=run.settings["planner"], threads=2).digest == run.digest


def test_drivers_keep_their_headway_of_the_start(tmp_path):
    path = tmp_path / "keeping.toml"
    path.write_text("format = 1\n[parameters.time_gap]\nmedian = 1.2\n[driver]\ntime_gap_kept = 0.5\n")
    # Gaps of 10.5 and 25.5 m at 10 m/s; nobody is ahead of the first, and the last one stands.
    cars = [Car(11, 100.0, 0.0, 10.0), Car(12, 85.0, 0.0, 10.0), Car(13, 55.0, 0.0, 10.0), Car(14, 10.0, 0.0, 0.0)]
    road = world(straight_road(600.0), cars=cars)
    gap = 15.0 - idr.simulate(road, planner="idm").states.length[0]
    planners = idr.simulate(road, agents=[11, 12, 13], planner=f"idm,drivers={path}").settings["planner"]
    assert planners["11"]["time_gap"] == pytest.approx(1.2)
    assert planners["12"]["time_gap"] == pytest.approx(1.2 * (gap / 10.0 / 1.5) ** 0.5)
    assert planners["13"]["time_gap"] == pytest.approx(1.2 * ((gap + 15.0) / 10.0 / 1.5) ** 0.5)
    drivers = read_drivers(str(path))
    assert drivers.settings("rollout", 0, 12, headway=6.0) == {
        "comfort.time_gap": pytest.approx(1.2 * (4.0 / 1.5) ** 0.5)
    }
    assert drivers.settings("idm", 0, 12)["time_gap"] == pytest.approx(1.2)
