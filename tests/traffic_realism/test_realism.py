"""The evaluation as a whole: rows, floors, refusals, the folder, and that it does not look into the future."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

import interdrive as idr
from interdrive import InputError
from interdrive.scenario import STATE_FIELDS
from interdrive.testing import Car, straight_road, world
from interdrive.traffic_realism import rollouts
from interdrive.traffic_realism.figure import floor_band
from interdrive.traffic_realism.folder import save_realism
from interdrive.traffic_realism.jobs import planning_from, rollout_settings
from interdrive.traffic_realism.windows import Recording, place_of, read_recordings, windows_of


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """Two lanes of a motorway for 20 s: columns at 18 and 20 m/s."""
    cars = [Car(101 + i, 30.0 * (i // 2) + 7.0 * (i % 2), 3.5 * (i % 2), 18.0 + 2.0 * (i % 2)) for i in range(14)]
    path = tmp_path_factory.mktemp("recording") / "DEU_Motorway-1_1_T-1.xml"
    idr.write_scenario(world(straight_road(900.0, 2), cars=cars, steps=100, dt=0.2, name=path.stem), path)
    return path


@pytest.fixture(scope="module")
def found(recording):
    return idr.realism(recording, ["idm", "idm_mobil,politeness=0.5"], long=16.0, starts=[1.0, 5.0])


def _rows(found):
    return {row.planner: row for row in found.rows}


def test_every_planner_stands_beside_the_recording_and_constant_velocity(found):
    rows = _rows(found)
    assert list(rows) == ["idm", "idm_mobil,politeness=0.5", "recorded", "constant_velocity"]
    assert {row.place for row in found.rows} == {"DEU_Motorway"}
    assert rows["idm"].windows == 2
    assert rows["idm"].vehicles == 28
    assert not rows["idm"].is_claim
    assert any("analog is left out" in note for note in found.notes)


def test_the_recording_is_as_good_as_itself(found):
    row = _rows(found)["recorded"]
    assert set(row.energy.values()) == {0.0}
    assert set(row.wasserstein.values()) == {0.0}
    assert set(row.auc.values()) == {0.5}
    assert (row.collisions, row.departures, row.not_admitted) == (0.0, 0.0, 0.0)


def test_vehicles_that_keep_their_speed_are_forecast_by_constant_velocity(found):
    rows = _rows(found)
    assert rows["constant_velocity"].energy[5] == pytest.approx(0.0, abs=1e-6)
    assert rows["idm"].energy[1] < rows["idm"].energy[5] < 10.0
    assert rows["idm"].energy_interval[5][0] <= rows["idm"].energy[5] <= rows["idm"].energy_interval[5][1]


@pytest.mark.long
def test_results_do_not_depend_on_the_number_of_processes(recording, found, tmp_path):
    again = idr.realism(recording, ["idm", "idm_mobil,politeness=0.5"], long=16.0, starts=[1.0, 5.0], workers=2)
    folders = [save_realism(one, tmp_path / name) for one, name in ((found, "one"), (again, "two"))]
    assert again.table.equals(found.table)
    for name in ("realism.json", "scores.parquet", "table.md"):
        assert (folders[0] / name).read_bytes() == (folders[1] / name).read_bytes(), name


def test_the_folder_has_tables_a_figure_a_page_and_rows_as_typed(found, tmp_path):
    folder = save_realism(found, tmp_path / "out")
    about = json.loads((folder / "realism.json").read_text())
    row = about["rows"][1]
    assert row["planner"] == "idm_mobil,politeness=0.5"
    assert set(row["energy"]) == {"1", "3", "5", "8"}
    assert set(row["auc"]) == {"lon_gap", "coarse", "lat", "all"}
    assert {"collisions", "not_admitted", "long_collisions", "spread", "persistence"} <= set(row)
    assert about["knows"] == "knows the recorded turns"
    scores = pq.read_table(folder / "scores.parquet").to_pylist()
    assert len(scores) == 4 * 28 * 4
    assert {name.name for name in folder.iterdir()} >= {"distributions.pdf", "realism.html", "table.csv"}
    assert "data:image/png" in (folder / "realism.html").read_text()


def test_lag_gaps_stand_beside_their_number(found, tmp_path):
    row = json.loads((save_realism(found, tmp_path / "out") / "realism.json").read_text())["rows"][1]
    assert {"lag_gap", "lag_gaps"} <= set(row)
    table = (tmp_path / "out" / "table.md").read_text()
    assert "| changes | lag gap [m] | of |" in table


def test_the_floor_of_the_figure_is_wide_where_windows_differ():
    edges = np.linspace(0.0, 4.0, 5)
    low, high = floor_band([np.full(10, 0.5)] * 3 + [np.full(10, 1.5)] * 3, edges)
    assert (low[0], high[0]) == (0.0, 1.0)
    assert (low[2], high[2]) == (0.0, 0.0), "nothing is there"
    low, high = floor_band([np.array([0.5, 1.5])] * 6, edges)
    assert low == pytest.approx([0.5, 0.5, 0.0, 0.0])
    assert high == pytest.approx(low)
    assert floor_band([np.ones(3)], edges) is None


def test_vehicles_plan_every_eight_seconds_but_in_windows_of_ngsim_once(recording, tmp_path):
    text = recording.read_text()
    source = re.search(r'source="[^"]*"', text)[0]
    (tmp_path / recording.name).write_text(text.replace(source, 'source="Next Generation Simulation (NGSIM)"'))
    times = {}
    for name, file in (("own", recording), ("ngsim", tmp_path / recording.name)):
        recordings, _ = read_recordings([file], raw=False, any_traffic=False)
        times[name] = [window.time for window in windows_of(recordings, horizon=8.0)]
    assert times == {"own": [1.0, 9.0], "ngsim": [1.0]}
    assert [window.time for window in windows_of(recordings, horizon=8.0, starts=[1.0, 5.0])] == [1.0, 5.0]


def test_what_is_not_simulated_has_no_collisions_rather_than_none(found):
    rows = _rows(found)
    assert np.isnan(rows["constant_velocity"].collisions)
    assert np.isnan(rows["constant_velocity"].not_admitted)
    assert (rows["recorded"].long_collisions, rows["recorded"].long_departures) == (0.0, 0.0)
    assert rows["recorded"].long_vehicles == rows["idm"].long_vehicles == 14


def test_rollouts_with_drivers_spread(recording):
    rows = _rows(idr.realism(recording, ["idm", "idm,drivers=house"], rollouts=3, long=0.0, starts=[1.0]))
    assert rows["idm"].energy[5] == rows["idm"].distance[5]
    assert rows["idm,drivers=house"].energy[5] < rows["idm,drivers=house"].distance[5] + 0.5
    assert rows["idm,drivers=house"].energy[5] != rows["idm,drivers=house"].distance[5]


def test_vehicles_beside_all_roads_cannot_be_judged(tmp_path):
    path = tmp_path / "DEU_Field-1_1_T-1.xml"
    cars = [Car(101, 20.0, 60.0, 15.0), Car(102, 60.0, 60.0, 15.0)]
    idr.write_scenario(world(straight_road(400.0), cars=cars, steps=60, dt=0.2, name=path.stem), path)
    with pytest.raises(InputError, match="no vehicle can be judged: none has a route"):
        idr.realism(path, "idm")


def _shaken(scenario, after):
    """The same with another course of all vehicles after a time step."""
    obstacles = scenario.obstacles
    tables = {name: getattr(obstacles, name).copy() for name in STATE_FIELDS}
    random = np.random.default_rng(0)
    for name, table in tables.items():
        noise = random.normal(size=table[:, after + 1 :].shape)
        table[:, after + 1 :] += noise * (0.2 if name == "y" else 1.0)
    return replace(scenario, obstacles=replace(obstacles, **tables))


def test_nothing_that_is_recorded_after_the_start_decides_how_vehicles_begin(recording):
    scenario = idr.read_scenario(recording)
    plans = []
    for one in (scenario, _shaken(scenario, 40)):
        window = windows_of([Recording("here", one, ())], horizon=8.0, starts=[8.0])[0]
        settings = planning_from(rollout_settings(None, "turns"), window)
        simulation = idr.Simulation(
            window.scenario, agents=window.judged.tolist(), planner="idm", settings=settings, threads=1
        )
        starts = [(agent.id, agent.initial_state, agent.goal[0].velocity) for agent in simulation.agents]
        for _ in range(window.start + 1):
            simulation.step()
        plans.append((starts, simulation.record().plans.to_arrow()))
    assert plans[0][0] == plans[1][0]
    assert plans[0][1].num_rows > 0
    assert plans[0][1].equals(plans[1][1])


def test_bicycles_and_people_go_on_replaying(recording):
    scenario = idr.read_scenario(recording)
    kinds = tuple("bicycle" if number == 103 else "car" for number in scenario.obstacles.ids.tolist())
    scenario = replace(scenario, obstacles=replace(scenario.obstacles, kinds=kinds))
    window = windows_of([Recording("here", scenario, ())], horizon=8.0, starts=[1.0])[0]
    assert 103 not in window.judged
    assert 103 not in rollouts.planning(window, planning_from(rollout_settings(None, "turns"), window))


def test_windows_of_one_recording_are_joined(recording, tmp_path):
    from windows import windows

    for one in windows(idr.read_scenario(recording), 51):
        idr.write_scenario(one, tmp_path / f"{one.name}.xml")
    recordings, _ = read_recordings([tmp_path], raw=False, any_traffic=False)
    assert len(recordings) == 1
    assert recordings[0].scenario.obstacles.n_steps == 101


def test_a_place_is_named_by_its_files():
    assert place_of("C-DEU_MONAEast-2_80_T-159") == "DEU_MONAEast"
    assert place_of("USA_US101-13_1_T-1") == "USA_US101"
    assert place_of("own recording") == "own recording"


def test_traffic_that_nobody_drove_is_refused():
    with pytest.raises(InputError, match=r"its traffic was not recorded .*any_traffic takes it"):
        idr.realism("t_junction", "idm")
    assert idr.realism("t_junction", "idm", any_traffic=True, long=0.0).rows


def test_a_data_set_is_recorded_although_its_name_says_simulation(recording, tmp_path):
    text = recording.read_text()
    source = re.search(r'source="[^"]*"', text)[0]
    for name, words in (("one", "Next Generation Simulation (NGSIM)"), ("two", "Next Generation Simulation, SUMO")):
        (tmp_path / f"USA_{name}-1_1_T-1.xml").write_text(text.replace(source, f'source="{words}"'))
    found, notes = read_recordings([tmp_path], raw=False, any_traffic=False)
    assert [one.place for one in found] == ["USA_one"]
    assert notes == ["USA_two-1_1_T-1.xml is left out: its traffic was not recorded (SUMO); any_traffic takes it"]


def test_vehicles_that_change_lanes_where_no_way_leads_are_measured(tmp_path):
    """The recording crosses from one road to another one beside it, to which no route leads."""
    lanes = straight_road(600.0, 2)
    nobody, nowhere, beside = np.full(2, -1), np.zeros(2, dtype=np.bool_), np.array([0.0, 4.0])
    apart = replace(
        lanes,
        left=(lanes.left[0], lanes.left[1] + beside),
        right=(lanes.right[0], lanes.right[1] + beside),
        adjacent_left=nobody,
        adjacent_right=nobody,
        adjacent_left_same_direction=nowhere,
        adjacent_right_same_direction=nowhere,
    )
    path = tmp_path / "DEU_Apart-1_1_T-1.xml"
    cars = [Car(101 + i, 40.0 * i, 0.0, 15.0) for i in range(3)]
    scenario = world(apart, cars=cars, steps=100, dt=0.2, name=path.stem)
    scenario.obstacles.y.setflags(write=True)
    scenario.obstacles.y[0] = np.clip(np.arange(101) * 0.25 - 2.0, 0.0, 7.5)
    idr.write_scenario(scenario, path)
    rows = _rows(idr.realism(path, "idm", long=0.0, starts=[1.0]))
    assert rows["idm"].vehicles == rows["recorded"].vehicles == 3


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"goals": "all"}, "goals: expected timed, place, route, turns, not 'all'"),
        ({"rollouts": 0}, "rollouts: expected at least 1"),
        ({"horizon": 1.0}, "horizon: expected at least 3.2"),
        ({"long": 5.0}, "long: expected 0, or at least 10"),
        ({"workers": 0}, "workers: expected at least 1"),
        ({"starts": [-1.0]}, "starts: expected times of at least 0 s"),
        ({"planners": ["idm", "idm"]}, "planner idm is given twice"),
        ({"planners": "recorded"}, "planner recorded: stands beside the others anyway"),
        ({"starts": [19.0]}, "no vehicle can be judged"),
        ({"starts": [400.0]}, "no vehicle can be judged"),
    ],
)
def test_impossible_wishes_are_refused_in_one_line(recording, options, words):
    with pytest.raises(InputError, match=words.replace("(", r"\(")) as caught:
        idr.realism(recording, **options)
    assert "\n" not in str(caught.value)


def test_constant_velocity_on_a_real_motorway_is_as_far_off_as_measured(real_recordings):
    places = idr.realism([Path(path) for path in real_recordings["MONAMerge"]], "idm", long=0.0)
    rows = _rows(places)
    assert rows["constant_velocity"].energy[5] == pytest.approx(4.62, abs=0.02)
    assert rows["idm"].energy[5] < 5.0
    assert rows["idm"].vehicles == 69


def test_contacts_with_vehicles_that_overlap_in_the_recording_are_no_collisions():
    cars = [Car(101, 0.0, 0.0, 12.0), Car(102, 40.0, 0.0, 0.0)]
    scenario = world(straight_road(400.0), cars=cars, steps=60, dt=0.2)
    for overlaps, expected in (((), 1), (((7, 102),), 0)):
        window = windows_of([Recording("here", replace(scenario, overlaps=overlaps), ())], horizon=8.0, starts=[1.0])[0]
        settings = planning_from(rollout_settings(None, "timed"), window)
        assert rollouts.simulated(window, "recorded", settings, [0], [101]).collisions == expected
