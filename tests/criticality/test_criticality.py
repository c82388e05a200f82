"""Criticality as people use it: arrays, runs, tables, files, the command."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner

import interdrive
from interdrive import _core
from interdrive.cli import main
from interdrive.criticality import (
    MEASURES,
    CriticalitySettings,
    evaluate,
    exposure,
    measure_named,
    minimal_stopping_distance,
    proportion_of_stopping_distance,
    required_acceleration,
    required_lateral_acceleration,
    time_headway,
    time_to_collision,
)
from interdrive.criticality.tables import (
    criticality_extremes_table,
    criticality_table,
    save_criticality,
    stored_criticality,
)
from interdrive.errors import InputError, ResultsError
from interdrive.files import run_document
from interdrive.results import save
from interdrive.runs import recorded_run, reopen
from interdrive.scenario import Incoming, Shape
from interdrive.simulation import simulate
from interdrive.testing import Car, crossing, problem, straight_road, world

NAMES = [measure.name for measure in MEASURES]


def invoke(*arguments):
    return CliRunner().invoke(main, list(arguments))


def following(gap=30.5, velocity=20.0, ahead=10.0, steps=20, **changes):
    """Two cars of 4.5 m on one lane, the first one behind."""
    cars = [Car(1, 10.0, velocity=velocity), Car(2, 10.0 + gap + 4.5, velocity=ahead)]
    return world(straight_road(400.0), cars=cars, steps=steps, **changes)


# Formulas


def test_formulas_take_arrays_of_any_shape_and_broadcast_them():
    headway = np.array([[30.0, 20.0], [30.0, 30.0]])
    ttc = time_to_collision(headway, [-10.0, -2.0], [[0.0, -0.1], [-2.0, 5.0]])
    assert ttc.shape == (2, 2)
    np.testing.assert_allclose(ttc[0], [3.0, 8.284271], rtol=1e-6)
    assert ttc[1, 0] == pytest.approx(2.416198)
    assert np.isinf(ttc[1, 1])
    assert time_headway(30.5, 20.0) == pytest.approx(1.525)
    assert time_headway([], []).shape == (0,)


def test_formulas_are_those_of_the_specification():
    assert required_acceleration(30.0, 20.0, 10.0) == pytest.approx(-5 / 3)
    assert required_acceleration(20.0, 10.0, 10.0, -5.0, leader_stops=True) == pytest.approx(-5 / 3)
    np.testing.assert_allclose(
        required_lateral_acceleration(3.0, [0.0, 0.8, -0.8, 2.5], 2.0), [4 / 9, 0.8 / 3, 0.8 / 3, 0]
    )
    # 1 m on the left or 2 m on the right are wanted; it is 0.4 m to the left, so 1.4 m or 1.6 m are missing.
    assert required_lateral_acceleration(2.0, 0.4, 1.0, 2.0) == pytest.approx(2 * 1.4 / 2.0**2)
    assert required_lateral_acceleration(2.0, 0.4, 2.0, 1.0) == pytest.approx(2 * 0.6 / 2.0**2)
    assert minimal_stopping_distance(20.0) == pytest.approx(17.391304)
    assert proportion_of_stopping_distance(30.0, minimal_stopping_distance(10.0)) == pytest.approx(6.9)
    assert exposure(3.005 - 0.1 * np.arange(26)) == pytest.approx((1.5, 1.1925))


def test_formulas_refuse_what_they_have_no_answer_for():
    with pytest.raises(InputError, match="headway must be positive"):
        required_acceleration([1.0, 0.0], 10.0, 5.0)
    with pytest.raises(InputError, match="deceleration must be positive"):
        minimal_stopping_distance(10.0, 0.0)
    with pytest.raises(InputError, match="time_steps"):
        exposure(np.zeros((2, 2)))
    with pytest.raises(InputError, match=r"exposure: dt must be positive, not -0\.1"):
        exposure([1.0], dt=-0.1)
    with pytest.raises(InputError, match=r"exposure: threshold must be positive, not 0\.0"):
        exposure([1.0], threshold=0.0)
    with pytest.raises(InputError, match=r"exposure: threshold must be positive, not inf"):
        exposure([1.0], threshold=np.inf)


def test_formulas_tell_a_free_road_from_what_is_not_known():
    headway = [np.inf, np.nan, 30.0]
    np.testing.assert_array_equal(time_to_collision(headway, -10.0), [np.inf, np.nan, 3.0])
    np.testing.assert_array_equal(time_headway(headway, 0.0), [np.inf, np.nan, np.inf])
    np.testing.assert_allclose(required_acceleration(headway, 20.0, 10.0, -2.0), [0.0, np.nan, -2.0 - 5 / 3])
    np.testing.assert_array_equal(required_lateral_acceleration([np.inf, np.nan], 0.0, 2.0), [0.0, np.nan])
    np.testing.assert_array_equal(proportion_of_stopping_distance([np.inf, np.nan], 0.0), [np.inf, np.nan])


def test_formulas_of_measured_headways_are_the_measures():
    found = evaluate(following(gap=6.0, velocity=12.0, ahead=10.0, steps=40))
    speed = 12.0 - 10.0
    hw = found["hw"]
    np.testing.assert_allclose(time_to_collision(hw[0], -speed), found["ttc"][0])
    np.testing.assert_allclose(time_to_collision(hw[1], speed), found["ttc"][1])
    assert np.isinf(found["ttc"][1, :30]).all()


# Evaluating


def test_a_recording_is_judged_vehicle_by_vehicle():
    found = evaluate(following())
    assert found.participant_id.tolist() == [1, 2]
    assert found["hw"].shape == (2, 21)
    assert found["hw"][0, 0] == pytest.approx(30.5)
    assert found["ttc"][0, 0] == pytest.approx(3.05)
    assert found["btn"][0, 0] == pytest.approx(100 / 61 / 11.5)
    assert np.isinf(found["ttc"][1]).all()
    assert found.series["ttc"].partner_id[0, 0] == 2
    assert found.paths[found.series["ttc"].path[0, 0]] == "1"
    assert found.extremes["ttc"].time_step.tolist() == [20, 0]


def test_only_those_asked_for_are_judged():
    found = evaluate(following(), [2])
    assert found.participant_id.tolist() == [2]
    assert found.row(2) == 0
    with pytest.raises(InputError, match="participant 1 was not evaluated"):
        found.row(1)


def test_others_can_be_left_out():
    cars = [Car(1, 10.0, velocity=20.0), Car(2, 45.0, velocity=10.0), Car(3, 75.0, velocity=10.0)]
    scenario = world(straight_road(400.0), cars=cars, steps=5)
    assert evaluate(scenario, [1])["hw"][0, 0] == pytest.approx(30.5)
    alone = evaluate(scenario, [1], other_ids=[3])
    assert alone["hw"][0, 0] == pytest.approx(60.5)
    assert set(alone.series["dce"].partner_id[0].tolist()) == {3}
    assert np.isinf(evaluate(scenario, [1], other_ids=[])["hw"]).all()


def test_arrays_cannot_be_written_to():
    found = evaluate(following())
    for array in (found["ttc"], found.present, found.extremes["ttc"].value, found.participant_id):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


def test_results_do_not_depend_on_threads():
    one, more = (evaluate(following(), threads=threads) for threads in (1, 4))
    for name in NAMES:
        assert one[name].tobytes() == more[name].tobytes()


def test_a_scenario_without_traffic_has_no_rows():
    found = evaluate(world(straight_road()))
    assert found["ttc"].shape == (0, 101)
    assert found.most_critical_moment() is None
    assert criticality_table(found).num_rows == 0
    assert any("no vehicle is evaluated" in note for note in found.notes)


def test_the_command_says_so_where_no_vehicle_is_judged_or_nothing_is_drawn(tmp_path, monkeypatch, scenarios_folder):
    monkeypatch.chdir(tmp_path)
    file = scenarios_folder / "format_edge_cases" / "test_reading_lanelets.xml"
    result = invoke("criticality", str(file), "--png")
    assert result.exit_code == 0, result.output
    assert "no vehicle is evaluated" in result.output
    assert "nothing is drawn" in result.output
    assert "no conflict in" not in result.output


def test_settings_reach_the_core():
    scenario = following()
    settings = CriticalitySettings(radius=20.0, deceleration=5.0, ttc_threshold=4.0, lateral_acceleration=4.0)
    found = evaluate(scenario, settings=settings)
    assert np.isinf(found["hw"][0, 0])
    assert found["msd"][0, 0] == pytest.approx(40.0)
    assert evaluate(scenario, settings=CriticalitySettings(ttc_threshold=4.0)).tet_seconds[0] == pytest.approx(2.1)
    recorded = evaluate(scenario, settings=CriticalitySettings(thw_mode="recorded"))
    assert recorded["thw"][0, 0] == pytest.approx(1.6)
    assert evaluate(scenario, deceleration={1: 5.0})["msd"][:, 0] == pytest.approx([40.0, 100 / 23])


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"radius": 0.0}, "radius: must be positive"),
        ({"deceleration": -1.0}, "deceleration: must be positive"),
        ({"opposite_angle": 3.2}, "opposite_angle: must be at most pi"),
        ({"erosion": float("nan")}, "erosion: must not be negative"),
    ],
)
def test_impossible_settings_are_refused(change, text):
    with pytest.raises(InputError, match=text):
        CriticalitySettings(**change)


def test_what_cannot_be_judged_is_refused_in_one_line():
    scenario = following()
    for ids, text in (([9], "no participant with id 9"), ([1, 1], "participant 1 is requested twice")):
        with pytest.raises(InputError, match=text):
            evaluate(scenario, ids)
    with pytest.raises(InputError, match="threads must be at least 1 and at most 1024, not 0"):
        evaluate(scenario, threads=0)
    with pytest.raises(InputError, match="no participant with id 8"):
        evaluate(scenario, other_ids=[8])
    with pytest.raises(InputError, match="participant 7: a deceleration is given for it, but it is not evaluated"):
        evaluate(scenario, deceleration={7: 4.0})
    with pytest.raises(InputError, match=r"available deceleration of participant 1 must be positive, not -2"):
        evaluate(scenario, deceleration={1: -2.0})
    static = replace(scenario, obstacles=replace(scenario.obstacles, is_static=np.array([False, True])))
    with pytest.raises(InputError, match="participant 2 is static"):
        evaluate(static, [2])
    x = scenario.obstacles.x.copy()
    x[0, 3] = np.nan
    with pytest.raises(InputError, match="participant 1 has a state that is not a number at time step 3"):
        evaluate(replace(scenario, obstacles=replace(scenario.obstacles, x=x)))


def test_core_and_package_agree_on_what_is_more_critical(monkeypatch):
    raw = {}
    original = _core.evaluate_criticality
    monkeypatch.setattr(_core, "evaluate_criticality", lambda *a, **k: raw.setdefault("found", original(*a, **k)))
    evaluate(following())
    assert {name: one["grows"] for name, one in raw["found"]["measures"].items()} == {m.name: m.grows for m in MEASURES}


def test_an_unknown_measure_is_refused_with_the_nearest_name():
    found = evaluate(following())
    with pytest.raises(InputError, match="there is no measure 'tcc'; did you mean ttc"):
        found["tcc"]
    with pytest.raises(InputError, match="there are hw, thw"):
        measure_named("quatsch")


def test_circles_polygons_and_single_steps_are_judged():
    scenario = following(steps=0)
    wedge = Shape("polygon", vertices=np.array([(3.0, 0.0), (-1.0, 1.0), (-1.0, -1.0)]))
    shapes = (Shape("circle", radius=1.0), wedge)
    found = evaluate(replace(scenario, obstacles=replace(scenario.obstacles, shapes=shapes)))
    assert found["hw"][0, 0] == pytest.approx(35.0 - 1.0 - 1.0)
    assert found["ttc"][0, 0] == pytest.approx(3.3)


def test_crossing_vehicles_have_conflict_areas_where_they_are_stated_or_looked_for():
    cars = [Car(1, -34.55, 0.0, 10.0), Car(2, 0.0, -64.55, 10.0, np.pi / 2)]
    scenario = world(crossing(), cars=cars, steps=90)
    found = evaluate(scenario)
    assert np.isinf(found["pet"]).all()
    assert "the map has no intersection" in found.notes[0]
    found = evaluate(scenario, settings=CriticalitySettings(conflict_areas="crossing"))
    # No lanelet leads to these or away from them: no route leads across.
    assert np.isinf(found["pet"]).all()
    stated = replace(scenario, incomings=(Incoming(5, 1, (7,), (1, 99)), Incoming(6, 1, (8,), (2,))))
    assert evaluate(stated).notes == ()


def test_intersections_are_read_from_files(scenarios_folder):
    scenario = interdrive.read_scenario(scenarios_folder / "t_junction" / "ZAM_Tjunction-1_42_T-1.xml")
    assert len(scenario.incomings) == 3
    assert {len(incoming.connector_ids) for incoming in scenario.incomings} == {2}
    found = evaluate(scenario)
    assert found.extremes["pet"].value[found.row(5)] == pytest.approx(0.6)
    assert " x " in found.paths[found.extremes["pet"].path[found.row(5)]]


# Runs


@pytest.fixture(scope="module")
def run():
    """Agent 1 follows a slow car."""
    problems = [problem(1, 10.0, velocity=12.0, goal=(180.0, 0.0), time_step=(0, 200))]
    scenario = world(straight_road(300.0), cars=[Car(7, 50.0, velocity=4.0)], problems=problems, steps=200)
    return simulate(scenario, agents=[1])


def test_a_run_judges_its_agents(run):
    found = run.criticality()
    assert found.participant_id.tolist() == [1]
    assert (found.series["hw"].partner_id[0, :20] == 7).all()
    both = run.criticality([1, 7], settings=CriticalitySettings(radius=30.0), threads=1)
    assert both.participant_id.tolist() == [1, 7]
    assert evaluate(run)["ttc"].tobytes() == found["ttc"].tobytes()


def test_a_collision_of_a_run_is_a_distance_of_zero_even_if_the_bodies_are_apart_after_the_step(run):
    ended = replace(
        run.outcomes,
        outcome=("collision",),
        time_step=np.array([8]),
        partner_id=np.array([7]),
        impact_speed=np.array([8.0]),
    )
    found = replace(run, outcomes=ended).criticality()
    assert (found["dce"][0, 0], found["ttce"][0, 0]) == (0.0, pytest.approx(0.8))
    assert found["ttc"][0, 8] == 0.0


def test_a_run_folder_is_judged_like_the_run(run, tmp_path):
    folder = save(run, tmp_path / "run")
    again = reopen(folder).criticality()
    found = run.criticality()
    for name in NAMES:
        np.testing.assert_allclose(again[name], found[name], rtol=1e-6, atol=1e-6)
    result = invoke("criticality", str(folder))
    assert result.exit_code == 0, result.output
    table = pq.read_table(folder / "criticality.parquet")
    assert table.num_rows == found.present.sum() * len(NAMES)
    # A folder with tables of criticality is still a run folder.
    save(run, folder, overwrite=True)


def test_a_run_folder_is_judged_on_the_road_that_was_simulated_even_if_the_file_has_changed(tmp_path):
    def drive(road):
        (tmp_path / "drive.xml").write_bytes(run_document(recorded_run(road)))
        return simulate(tmp_path / "drive.xml", agents=1, predictor="constant_velocity", threads=1)

    folder = save(drive(following()), tmp_path / "run")
    found = criticality_table(reopen(folder).criticality())
    drive(replace(following(), lanelets=straight_road(700.0)))  # the same file, another road
    assert len(reopen(folder).scenario.lanelets.left[0]) == len(following().lanelets.left[0])
    assert criticality_table(reopen(folder).criticality()).num_rows == found.num_rows


@pytest.mark.parametrize("name", ["criticality.parquet", "criticality_extremes.parquet"])
def test_one_table_of_criticality_without_the_other_is_refused(run, tmp_path, name):
    folder = save(run, tmp_path / "run")
    save_criticality(run.criticality(), folder)
    (folder / name).unlink()
    with pytest.raises(ResultsError, match=f"{name}: .* is missing"):
        stored_criticality(folder)


# Tables


def test_the_table_has_a_row_per_vehicle_time_step_and_measure():
    found = evaluate(following(steps=3))
    table = criticality_table(found)
    assert table.column_names == ["participant_id", "time_step", "measure", "unit", "value", "partner_id", "path"]
    assert table.num_rows == 2 * 4 * len(NAMES)
    rows = table.to_pylist()
    assert [row["measure"] for row in rows[: len(NAMES)]] == NAMES
    assert rows[2] == {
        "participant_id": 1,
        "time_step": 0,
        "measure": "ttc",
        "unit": "s",
        "value": pytest.approx(3.05),
        "partner_id": 2,
        "path": "1",
    }
    assert rows[4 * len(NAMES) + 2]["value"] == float("inf")
    assert rows[4 * len(NAMES) + 2]["partner_id"] is None
    later = criticality_table(replace(found, first_time_step=40))
    assert later["time_step"].to_pylist() == [40 + row["time_step"] for row in rows]
    off_road = replace(found, series={**found.series, "hw": replace(found.series["hw"], value=np.full((2, 4), np.nan))})
    assert criticality_table(off_road)["value"].to_pylist()[0] is None


def test_the_table_of_extremes_has_a_row_per_vehicle_and_measure():
    found = evaluate(following())
    rows = criticality_extremes_table(found).to_pylist()
    assert len(rows) == 2 * len(NAMES)
    assert rows[NAMES.index("ttc")]["value"] == pytest.approx(1.05)


# The command


def test_the_command_judges_a_file_and_writes_tables_and_pictures(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = invoke("criticality", "t_junction", "--png", "--threads", "1")
    assert result.exit_code == 0, result.output
    folder = tmp_path / "out" / "t_junction-criticality"
    made = sorted(path.name for path in folder.iterdir())
    assert made == ["criticality.parquet", "criticality.png", "criticality_extremes.parquet", "criticality_moment.png"]
    assert "time to collision" in result.output
    assert "vehicles judged at" in result.output
    assert "out/t_junction-criticality" in result.output


def test_the_command_ranks_the_pairs_of_all_files_in_a_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "in" / "town").mkdir(parents=True)
    near = world(straight_road(), cars=[Car(11, 20.0, velocity=10.0), Car(12, 40.0, velocity=5.0)])
    far = world(straight_road(), cars=[Car(13, 20.0, velocity=10.0), Car(14, 80.0, velocity=8.0)])
    for name, scenario in (("near", near), ("far", far)):
        (tmp_path / "in" / "town" / f"{name}.xml").write_bytes(run_document(recorded_run(scenario)))
    result = invoke("criticality", "in", "--pairs", "5", "--out", "tables")
    assert result.exit_code == 0, result.output
    rows = [line.split()[:3] for line in result.output.splitlines() if " ttc " in line]
    assert rows == [["near", "11", "12"], ["far", "13", "14"]]
    assert sorted(path.name for path in (tmp_path / "tables" / "town").iterdir()) == ["far", "near"]
    (tmp_path / "in" / "broken.xml").write_text("<nothing/>")
    result = invoke("criticality", "in", "--out", "again")
    assert result.exit_code == 2
    assert "2 of 3 files evaluated" in result.output


def test_pairs_are_ranked_by_their_most_critical_moment():
    found = evaluate(following())
    (pair,) = found.most_critical_pairs("ttc", 9)
    assert pair == found.most_critical("ttc")
    assert found.most_critical_pairs("btn", 9)[0].value == found.most_critical("btn").value
    assert found.most_critical_pairs("ttc", 0) == ()


def test_the_command_judges_the_named_vehicles_with_settings(tmp_path):
    out = tmp_path / "tables"
    result = invoke(
        "criticality", "highway", "--participants", "1001,1002", "--set", "radius=30", "--out", str(out), "--quiet"
    )
    assert (result.exit_code, result.output) == (0, "")
    assert pq.read_table(out / "criticality.parquet")["participant_id"].unique().to_pylist() == [1001, 1002]


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (("nowhere.xml",), "nowhere.xml: no such file"),
        (("highway", "--participants", "1,x"), "--participants 1,x: write them as"),
        (("highway", "--participants", ","), "--participants ,: write them as"),
        (("highway", "--participants", ""), "--participants : write them as"),
        (("highway", "--participants", "424242"), "there is no participant with id 424242"),
        (("highway", "--set", "radius=-1"), "radius: must be positive"),
        (("highway", "--set", "radiu=1"), "did you mean radius?"),
        (("highway", "--set", "thw_mode=quick"), "expected one of normalized, recorded"),
    ],
)
def test_the_command_refuses_in_one_line(arguments, text, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = invoke("criticality", *arguments)
    assert result.exit_code == 2
    assert text in result.output
    assert result.output.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_a_folder_without_run_and_scenarios_is_refused(tmp_path):
    result = invoke("criticality", str(tmp_path))
    assert result.exit_code == 2
    assert "this folder holds no scenario files" in result.output


# Figures


def test_figures_show_the_vehicle_and_the_moment():
    from interdrive.plots import draw_critical_moment, draw_criticality

    scenario = following()
    found = evaluate(scenario)
    moment = found.most_critical_moment()
    assert (moment.measure, moment.participant_id, moment.partner_id, moment.time_step) == ("ttc", 1, 2, 20)
    figure = draw_criticality(found, 1)
    assert len([axes for axes in figure.axes if axes.get_title(loc="left")]) == len(NAMES)
    assert "no conflict" in [text.get_text() for text in figure.axes[NAMES.index("pet")].texts]
    scene = draw_critical_moment(recorded_run(scenario), moment)
    assert "time to collision along lanes 1.05 s at 2.0 s" in scene.axes[0].get_title(loc="left")
    with pytest.raises(InputError, match="was not evaluated"):
        draw_criticality(found, 5)
    with pytest.raises(InputError, match="the moment of msd has no partner: there is no encounter to draw"):
        draw_critical_moment(recorded_run(scenario), found.most_critical("msd"))


# Every recorded scenario


def test_every_recorded_scenario_can_be_judged(recorded_scenarios):
    n_values = 0
    for name, scenario in recorded_scenarios.items():
        if isinstance(scenario, InputError):
            continue
        found = evaluate(scenario, settings=CriticalitySettings(conflict_areas="crossing"))
        assert found.present.shape == (len(found.participant_id), scenario.obstacles.n_steps), name
        for measure in NAMES:
            values = found[measure]
            assert np.isnan(values[~found.present]).all(), (name, measure)
            known = values[found.present & ~np.isnan(values)]
            assert (known <= 0.0).all() if measure == "a_long_req" else (known >= 0.0).all(), (name, measure)
            n_values += len(known)
        # What always can be computed is always there.
        for measure in ("dce", "ttce", "msd", "tet", "tit", "psd"):
            assert not np.isnan(found[measure][found.present]).any(), (name, measure)
        # The distance never shrinks as encounters pass; the time to it runs down by a step at a time.
        dce = found["dce"]
        both = found.present[:, 1:] & found.present[:, :-1]
        later, earlier = dce[:, 1:][both], dce[:, :-1][both]
        assert (later >= earlier).all(), name
    assert n_values > 500_000
