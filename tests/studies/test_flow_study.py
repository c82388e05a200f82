"""Fundamental diagrams on rings."""

import json
import math
from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner

from interdrive import InputError, SimulationSettings
from interdrive.cli import main
from interdrive.cli.traffic_report import print_capacities
from interdrive.simulation import simulate
from interdrive.storage import arrow_table, read_table
from interdrive.studies.flow import COLUMNS, FLOW_FOLDER, capacities, flow_figure, flow_study, save_flow
from interdrive.studies.flow.measure import ring_road


@pytest.fixture(scope="module")
def study():
    return flow_study(
        ["idm", "idm_mobil"],
        densities=(10.0, 50.0),
        lanes=(1,),
        duration=12.0,
        warm_up=8.0,
        settings=SimulationSettings(),
        threads=1,
    )


def test_flow_is_density_times_speed_and_falls_short_of_the_limit_when_dense(study):
    rows = study.table.to_pylist()
    assert [(row["planner"], row["lanes"]) for row in rows] == [
        ("idm", 1),
        ("idm", 1),
        ("idm_mobil", 1),
        ("idm_mobil", 1),
    ]
    for row in rows:
        assert row["flow"] == pytest.approx(3.6 * row["density"] * row["speed"])
        assert row["density"] == pytest.approx(1000.0 * row["vehicles"] / row["length"])
        assert row["collisions"] == 0
    free, dense = rows[0], rows[1]
    # A ring of 1000 m bends so much that 2 m/s² across are reached at sqrt(2 · 1000 / 2π).
    assert free["speed"] == pytest.approx(17.8, abs=0.3)
    # Equilibrium of the IDM for a gap of 1000 m / 50 - 4.6 m: (2 + v) / sqrt(1 - (v / 17.8)^4) = 15.4.
    assert dense["speed"] == pytest.approx(11.6, abs=1.0)


def test_a_planner_with_settings_is_a_row_of_its_own():
    options = {"densities": (50.0,), "lanes": (1,), "duration": 12.0, "warm_up": 8.0, "threads": 1}
    found = flow_study(["idm,time_gap=0.8", "idm,time_gap=2.0"], settings=SimulationSettings(), **options)
    close, far = found.table.to_pylist()
    assert (close["planner"], far["planner"]) == ("idm,time_gap=0.8", "idm,time_gap=2.0")
    assert close["speed"] > far["speed"] + 1.0, "m/s: at one density those who keep closer drive faster"


def test_capacity_is_the_largest_flow(study):
    first, second = capacities(study)
    assert (first.planner, second.planner) == ("idm", "idm_mobil")
    assert first.flow == max(row["flow"] for row in study.table.to_pylist() if row["planner"] == "idm")
    assert math.isnan(first.wave_speed)
    assert first.collisions == 0


def test_a_largest_flow_at_the_edge_of_the_densities_is_no_capacity(study, capsys):
    rows = study.table.to_pylist()[:2]

    def told(flows):
        one = {name: [row[name] for row in rows[:1]] * len(flows) for name in study.table.column_names}
        one |= {"flow": flows, "density": [10.0 * (i + 1) for i in range(len(flows))]}
        made = replace(study, table=arrow_table(COLUMNS, one), planners=("idm",))
        print_capacities(made, Path("made"))
        return capacities(made)[0].edge, capsys.readouterr().out

    assert told([900.0, 1200.0, 1500.0])[0] == "high"
    edge, text = told([1500.0, 1200.0, 900.0])
    assert edge == "low"
    assert "at least 1500" in text
    assert "10 or less" in text
    assert "the capacity lies beyond" in text
    edge, text = told([900.0, 1500.0, 1200.0])
    assert edge == ""
    assert "at least" not in text


def test_the_folder_has_table_and_figure(study, tmp_path):
    folder = save_flow(study, tmp_path / "flow")
    assert sorted(entry.name for entry in folder.iterdir()) == [
        "flow.json",
        "flow.pdf",
        "flow.png",
        "table.csv",
        "table.parquet",
    ]
    assert all(FLOW_FOLDER.belongs(entry) for entry in folder.iterdir())
    assert read_table(folder / "table.parquet", COLUMNS).num_rows == 4
    assert len(flow_figure(study).axes) == 2
    written = json.loads((folder / "flow.json").read_text())["settings"]
    assert written["traffic.mix"] == [1.0, 0.0, 0.0]
    assert written["traffic.speed_factor"] == [1.0, 0.0]
    assert written["traffic.time_gap"] is None
    assert written["traffic.duration"] == 12.0
    assert written["traffic.warm_up"] == 8.0
    assert written["record.violations"] is False
    assert "traffic.planner" not in written, "each row has its own"


def test_a_ring_has_lanes_side_by_side_that_lead_into_themselves():
    lanelets = ring_road(1000.0, 2).lanelets
    assert len(lanelets.ids) == 16
    assert lanelets.successors[7] == (1,)
    assert lanelets.adjacent_left[0] == 9
    assert lanelets.adjacent_right[8] == 1


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["flow", "--density", "0"], "write vehicles per km from 1 to 180"),
        (["flow", "--planner", "idm,rollout,idm"], "planner: idm is given twice"),
        (["flow", "--density", "10,20,10"], "density: 10 is given twice"),
        (["flow", "--set", "traffic.mix=0,1,0"], "traffic.mix: has no effect on a study of flow"),
        (["flow", "--set", "agents.min_displacement=3"], "agents.min_displacement: has no effect"),
        (["flow", "--seeds", "2"], "study flow: --seeds belongs to `interdrive study cooperation`"),
        (["merge", "--density", "5"], "--density belongs to `interdrive study flow`"),
    ],
)
def test_bad_options_give_one_line(words, text, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(main, ["study", *words])
    assert done.exit_code == 2
    assert text in done.output


def test_an_unknown_planner_is_named():
    with pytest.raises(InputError, match="unknown planner 'nothing'"):
        flow_study(
            ["nothing"],
            densities=(10.0,),
            lanes=(1,),
            warm_up=1.0,
            duration=2.0,
            settings=SimulationSettings(),
            threads=1,
        )


def spread(planner, seconds, **settings):
    """Standard deviation of speeds [m/s] on a ring of 1 km with 60 vehicles, in the first and last 20 s of a run."""
    cars = {"traffic.mix": (1.0, 0.0, 0.0), "traffic.speed_factor": (1.0, 0.0), "traffic.time_gap": None}
    run = simulate(
        ring_road(1000.0, 1),
        agents=0,
        predictor="lane_following",
        traffic={"planner": planner, "density": 60.0, "duration": seconds},
        settings={"record.violations": False, "record.orders": False, **cars, **settings},
        threads=1,
    )
    assert "collision" not in run.outcomes.outcome
    own = run.states.velocity.std(axis=0)
    return own[:200].mean(), own[-200:].mean()


@pytest.mark.long
@pytest.mark.parametrize(("acceleration", "waves"), [(0.4, True), (4.0, False)])
def test_waves_grow_in_strings_of_idm_that_are_unstable_by_theory(acceleration, waves):
    # Treiber, Kesting, "Traffic Flow Dynamics", 2013, section 15.4: unstable where the speed of equilibrium grows more
    # with the gap (here 0.79 /s) than half of what the acceleration changes with both speeds: 0.43 /s for 0.4 m/s²,
    # 1.63 /s for 4 m/s².
    before, after = spread("idm", 90.0, **{"planner.idm.acceleration": acceleration})
    assert (after > 2.0 * before) if waves else (after < before)


@pytest.mark.long
def test_strings_of_rollout_are_at_least_as_stable_as_those_of_idm():
    _, following = spread("idm", 90.0)
    before, after = spread("rollout", 90.0)
    assert after <= 1.1 * before
    assert after <= following


@pytest.mark.long
@pytest.mark.parametrize(("length", "density", "seconds"), [(1383.31, 60.0, 4.0), (1000.0, 80.0, 8.0)])
def test_who_begins_near_the_start_of_its_lanelet_stays_in_lanes_that_go_around_the_ring(length, density, seconds):
    run = simulate(
        ring_road(length, 2),
        agents=0,
        predictor="lane_following",
        traffic={"planner": "idm_mobil", "density": density, "duration": seconds, "mix": (1, 0, 0), "time_gap": None},
        settings={"record.violations": False, "record.orders": False, "traffic.speed_factor": (1.0, 0.0)},
        threads=1,
    )
    assert len(run.agents) > 150
    assert set(run.outcomes.outcome) == {"goal_reached"}
