"""Many runs into one data set: what is run, what is stored, what is refused."""

import json
import math
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from invented_run import invented_run

import interdrive as idr
from interdrive.batches import COLUMNS, BatchFolder
from interdrive.batches.columns import comfort
from interdrive.batches.plan import choices, planned, scenario_files
from interdrive.config.binding import bind
from interdrive.config.schema import SimulationSettings
from interdrive.files import shipped_scenario

pytestmark = pytest.mark.long

FAST = "idm"


def plan(paths=("t_junction",), **changes):
    given = {
        "planner": FAST,
        "predictor": "neural",
        "agents": "all",
        "traffic": None,
        "alone": False,
        "seeds": 1,
        "settings": SimulationSettings(),
        **changes,
    }
    return planned(paths, **given)


@pytest.fixture(scope="module")
def two_planners(tmp_path_factory):
    """A batch of two scenarios and two planners, with all run folders."""
    out = tmp_path_factory.mktemp("batch") / "out"
    return idr.batch(["t_junction", "lane_merge"], out, planner=f"{FAST},idm_mobil,time_gap=2.0", keep="all", workers=2)


def interdrive(*arguments, cwd=None):
    return subprocess.run(
        [sys.executable, "-m", "interdrive", *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
        cwd=cwd,
    )


def test_every_combination_is_one_run(two_planners):
    rows = two_planners.table.to_pylist()
    runs = {(row["scenario"], row["planner"]) for row in rows}
    assert runs == {(s, p) for s in ("t_junction", "lane_merge") for p in (FAST, "idm_mobil,time_gap=2.0")}
    assert len({row["key"] for row in rows}) == len(two_planners.keys) == 4
    assert two_planners.status == {"finished": 4}


def test_a_run_of_a_batch_is_the_run_that_simulate_makes(two_planners):
    alone = idr.simulate("lane_merge", planner="idm_mobil,time_gap=2.0", threads=2)
    rows = [
        row
        for row in two_planners.table.to_pylist()
        if row["scenario"] == "lane_merge" and row["planner"].startswith("idm_mobil")
    ]
    assert {row["digest"] for row in rows} == {alone.digest}
    assert [row["agent_id"] for row in rows] == alone.outcomes.agent_id.tolist()
    assert tuple(row["outcome"] for row in rows) == alone.outcomes.outcome
    found = alone.criticality()
    for i, row in enumerate(rows):
        assert row["ttc_min"] == found.extremes["ttc"].value[i]
        assert row["btn_max"] == found.extremes["btn"].value[i]
        assert row["ttc_critical"] == pytest.approx(found.tet_seconds[i] / (alone.scenario.dt * found.present[i].sum()))


def test_comfort_is_that_of_the_planned_states(two_planners):
    row = next(row for row in two_planners.table.to_pylist() if row["scenario"] == "t_junction")
    run = idr.simulate("t_junction", planner=FAST)
    states, at = run.states, int(np.searchsorted(run.states.participant_id, row["agent_id"]))
    there = states.valid[at]
    acceleration = states.acceleration[at, there][1:]
    lateral = (states.velocity[at, there] * states.yaw_rate[at, there])[1:]
    assert row["jerk_rms"] == pytest.approx(math.sqrt(np.mean((np.diff(acceleration) / 0.1) ** 2)))
    assert row["deceleration_max"] == pytest.approx(-acceleration.min())
    assert row["lateral_acceleration_max"] == pytest.approx(np.abs(lateral).max())
    assert row["seconds"] == pytest.approx(0.1 * (there.sum() - 1))
    assert 0 < row["plan_seconds"] < 0.1


def test_comfort_does_not_count_the_state_that_the_scenario_gave():
    """By hand: agent 4 begins at time step 5 with a = -3 and yaw rate 0.5; then a is 0, 1, 1 at 2 m/s and 0.1 rad/s."""
    run = invented_run()
    at = int(np.searchsorted(run.states.participant_id, 4))
    valid = run.states.valid.copy()
    valid[at] = False
    valid[at, 5:9] = True
    values = {"acceleration": [-3.0, 0.0, 1.0, 1.0], "velocity": [2.0] * 4, "yaw_rate": [0.5, 0.1, -0.1, 0.1]}
    changed = {name: getattr(run.states, name).copy() for name in values}
    for name, own in values.items():
        changed[name][at, 5:9] = own
    found = comfort(replace(run, states=replace(run.states, valid=valid, **changed)))
    last = {name: column[-1] for name, column in found.items()}
    assert last["jerk_max"] == pytest.approx(1.0 / 0.1)
    assert last["jerk_rms"] == pytest.approx(math.sqrt(10.0**2 / 2))
    assert last["acceleration_rms"] == pytest.approx(math.sqrt(2.0 / 3.0))
    assert last["deceleration_max"] == 0.0
    assert last["lateral_acceleration_rms"] == pytest.approx(0.2)
    assert last["lateral_acceleration_max"] == pytest.approx(0.2)
    assert last["seconds"] == pytest.approx(0.3)


def test_agents_without_a_planned_state_have_no_comfort():
    run = invented_run()
    valid = run.states.valid.copy()
    valid[int(np.searchsorted(run.states.participant_id, 4)), 6:] = False
    found = comfort(replace(run, states=replace(run.states, valid=valid)))
    names = ("jerk_rms", "acceleration_rms", "deceleration_max", "lateral_acceleration_max")
    assert all(math.isnan(found[name][-1]) for name in names)
    assert found["seconds"][-1] == 0.0


def test_the_data_set_has_the_columns_it_says_and_other_tools_read_it(two_planners):
    import pandas as pd
    import polars as pl

    path = BatchFolder.open(two_planners.folder).results
    assert pq.read_schema(path).names == [column.name for column in COLUMNS]
    assert pq.read_schema(path).field("jerk_rms").metadata[b"description"].decode().endswith("[m/s³]")
    n = two_planners.table.num_rows
    assert len(pd.read_parquet(path)) == pl.read_parquet(path).height == n
    assert pl.scan_parquet(path).select("outcome").collect().height == n


def test_a_kept_run_folder_is_a_whole_one_and_can_be_verified(two_planners):
    row = two_planners.table.to_pylist()[0]
    folder = BatchFolder.open(two_planners.folder).recording(row["key"])
    assert row["kept"]
    assert idr.load(folder).digest == row["digest"]
    assert interdrive("verify", folder).returncode == 0


def test_a_second_call_does_only_what_is_missing(tmp_path):
    first = idr.batch("t_junction", tmp_path, planner=FAST, workers=1)
    changed = BatchFolder.open(tmp_path).results.stat().st_mtime_ns
    second = idr.batch("t_junction", tmp_path, planner=FAST, workers=1)
    assert (first.found, second.found) == (0, 1)
    assert BatchFolder.open(tmp_path).results.stat().st_mtime_ns == changed
    third = idr.batch(["t_junction", "lane_merge"], tmp_path, planner=FAST, workers=1)
    assert third.found == 1
    assert len(set(third.table["key"].to_pylist())) == 2


def test_keeping_run_folders_later_does_those_runs_again_with_the_same_digest(tmp_path):
    first = idr.batch("t_junction", tmp_path, planner=FAST, workers=1)
    again = idr.batch("t_junction", tmp_path, planner=FAST, workers=1, keep="all")
    assert (first.keys, again.found) == (again.keys, 0)
    assert first.table["digest"].to_pylist() == again.table["digest"].to_pylist()
    assert BatchFolder.open(tmp_path).recording(first.keys[0]).is_dir()


def test_a_number_of_agents_is_tested_among_recorded_adjusting_or_equal_traffic(tmp_path):
    tables = {
        traffic: idr.batch("t_junction", tmp_path, planner=FAST, agents=2, traffic=traffic, workers=1).table.to_pylist()
        for traffic in ("recorded", "velocity_adjusting", "same")
    }
    for traffic, rows in tables.items():
        assert sum(row["under_test"] for row in rows) == 2
        assert {row["agent_planner"] for row in rows if row["under_test"]} == {FAST}
        others = {row["agent_planner"] for row in rows if not row["under_test"]}
        assert others == {"recorded": set(), "velocity_adjusting": {"velocity_adjusting"}, "same": {FAST}}[traffic]
    tested = [{row["agent_id"] for row in rows if row["under_test"]} for rows in tables.values()]
    assert tested[0] == tested[1] == tested[2]


def test_a_planning_problem_without_recording_is_no_adjusting_traffic(tmp_path):
    """Agent 2001 of the T-junction was not recorded; when a recorded car is tested it is not there."""
    done = idr.batch("t_junction", tmp_path, planner=FAST, alone=True, traffic="velocity_adjusting", workers=2)
    assert done.status == {"finished": 8}
    rows = done.table.to_pylist()
    with_problem = {row["key"] for row in rows if row["agent_id"] == 2001}
    assert with_problem == {row["key"] for row in rows if row["agent_id"] == 2001 and row["under_test"]}
    assert len(with_problem) == 1


def test_alone_every_agent_has_a_run_of_its_own(tmp_path):
    done = idr.batch("lane_merge", tmp_path, planner=FAST, alone=True, workers=2)
    rows = done.table.to_pylist()
    all_ids = idr.simulate("lane_merge", planner=FAST).outcomes.agent_id.tolist()
    assert sorted(row["agent_id"] for row in rows) == all_ids
    assert len(done.keys) == len(all_ids)
    assert {row["traffic"] for row in rows} == {"recorded"}
    one = idr.simulate("lane_merge", agents=[all_ids[0]], planner=FAST)
    assert next(row["digest"] for row in rows if row["agent_id"] == all_ids[0]) == one.digest


def test_agents_are_listed_for_runs_of_single_agents_only(tmp_path):
    with pytest.raises(idr.InputError, match="listed: agents are listed for runs of single agents; add alone"):
        idr.batch("lane_merge", tmp_path, planner=FAST, listed={}, workers=1)
    assert not list(tmp_path.iterdir())


def test_alone_an_agent_that_several_seeds_chose_is_driven_once(tmp_path):
    done = idr.batch("lane_merge", tmp_path, planner=FAST, agents=6, alone=True, seeds=3, workers=2)
    rows = done.table.to_pylist()
    under_test = [row["agent_id"] for row in rows if row["under_test"]]
    assert len(under_test) == len(set(under_test)) == 7  # three times six of seven
    assert len({row["digest"] for row in rows}) == len(done.keys) == sum(done.status.values()) == 7
    assert {row["seed"] for row in rows} == {0}
    again = idr.batch("lane_merge", tmp_path, planner=FAST, agents=6, alone=True, seeds=3, workers=1)
    assert again.found == 7


def test_more_agents_than_there_can_be_are_all_agents(tmp_path):
    done = idr.batch("lane_merge", tmp_path, planner=FAST, agents=99, workers=1)
    assert sum(row["under_test"] for row in done.table.to_pylist()) == 7


def test_seeds_choose_other_agents():
    specs = plan(agents=2, seeds=3).specs
    assert [spec.seed for spec in specs] == [0, 1, 2]
    assert len({spec.key for spec in specs}) == 3


def test_the_key_says_scenario_choices_and_settings_and_nothing_else(tmp_path):
    from interdrive.files import shipped_scenario

    elsewhere = tmp_path / "other" / "name.xml"
    elsewhere.parent.mkdir()
    elsewhere.write_bytes(shipped_scenario("t_junction").read_bytes())
    key = plan().specs[0].key
    assert plan((elsewhere,)).specs[0].key == key
    slower = bind(SimulationSettings(), {"planner.idm.time_gap": 2.0})
    others = [
        plan(("lane_merge",)),
        plan(planner="idm_mobil"),
        plan(predictor="constant_velocity"),
        plan(agents=3),
        plan(agents=3, traffic="same"),
        plan(settings=slower),
    ]
    keys = [other.specs[0].key for other in others]
    assert len({key, *keys}) == 7


def test_a_changed_planner_is_another_planner_also_in_the_same_session(tmp_path, monkeypatch):
    module = tmp_path / "mine_for_keys.py"
    module.write_text("class Mine:\n    def plan(self, view, predictions): ...\n")
    monkeypatch.syspath_prepend(tmp_path)
    same = {"planner": "mine_for_keys:Mine", "settings": SimulationSettings()}
    (spec,) = plan(**same).specs
    (again,) = plan(**same).specs
    assert again.key == spec.key
    module.write_text("class Mine:\n    def plan(self, view, predictions): ...\n\n")
    (changed,) = plan(**same).specs
    assert changed.key != spec.key
    assert changed.of_agents([1]).key != spec.of_agents([1]).key == again.of_agents([1]).key


def test_the_policy_that_a_planner_drives_by_is_part_of_the_key(tmp_path):
    keys = set()
    for content in (b"first", b"second"):
        (tmp_path / "policy").write_bytes(content)
        keys.add(plan(planner=f"policy,file={tmp_path / 'policy'}").specs[0].key)
    assert len(keys) == 2


@pytest.mark.parametrize("planner", ["velocity_adjusting", "velocity_adjusting,time_gap=2.0"])
def test_a_planner_with_settings_is_not_judged_for_agents_that_it_cannot_drive_either(planner, tmp_path):
    """Agent 2001 of the T-junction was not recorded."""
    rows = idr.batch("t_junction", tmp_path, planner=planner, workers=1).table.to_pylist()
    assert {row["agent_planner"] for row in rows if row["under_test"]} == {"velocity_adjusting"}
    assert [row["agent_id"] for row in rows if not row["under_test"]] == [2001]


def test_the_version_of_a_library_that_a_planner_needs_is_part_of_the_key(monkeypatch):
    from interdrive.batches import plan as planning

    keys = set()
    for version in ("0.4.0", "0.4.1"):
        monkeypatch.setattr(planning, "versions", lambda name, what, version=version: {name: version})
        keys.add(plan(settings=SimulationSettings()).specs[0].key)
    assert len(keys) == 2


def test_a_file_that_a_setting_names_is_part_of_the_key(tmp_path):
    from interdrive.predictors.neural import SHIPPED

    weights = tmp_path / "own.safetensors"
    weights.write_bytes(SHIPPED.read_bytes())
    chosen = f"neural,weights={weights}"
    settings = SimulationSettings()
    key = plan(predictor=chosen, settings=settings).specs[0].key
    assert plan(predictor=chosen, settings=settings).specs[0].key == key
    weights.write_bytes(SHIPPED.read_bytes() + b" ")
    assert plan(predictor=chosen, settings=settings).specs[0].key != key


@pytest.mark.parametrize(
    ("text", "labels"),
    [
        ("frenet", ["frenet"]),
        ("frenet,idm", ["frenet", "idm"]),
        ("frenet,level=1,idm,time_gap=2.0,frenet", ["frenet,level=1", "idm,time_gap=2.0", "frenet"]),
        ("a:B,levels=[1,2],c", ["a:B,levels=[1,2]", "c"]),
        (["idm", "frenet,level=1"], ["idm", "frenet,level=1"]),
        (idr.Idm(), ["idm"]),
        ({"mine": idr.Idm(), "other": "idm"}, ["mine", "other"]),
    ],
)
def test_planners_are_separated_where_a_name_begins(text, labels):
    assert list(choices(text, "planner")) == labels


def test_a_folder_is_searched_but_not_its_results_and_hidden_folders(tmp_path, two_planners):
    from interdrive.files import shipped_scenario

    for name in ("highway/a.xml", "b.xml", ".hidden/c.xml", "result/d.xml"):
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(f"<commonRoad>{name}</commonRoad>")
    (tmp_path / "result" / "run.json").write_text("{}")
    (tmp_path / "notes.txt").write_text("no scenario")
    (tmp_path / "twice.xml").write_bytes((tmp_path / "b.xml").read_bytes())
    files, notes = scenario_files([tmp_path, shipped_scenario("t_junction")])
    assert [(file.name, file.category) for file in files[:2]] == [("b", tmp_path.name), ("a", "highway")]
    assert len(files) == 3
    assert len(notes) == 1
    assert "same content" in notes[0]


def test_a_protobuf_scenario_is_one_run_whose_key_knows_its_map(tmp_path):
    """In commonroad-io from 2026.1 on it consists of three files, which all travel to other machines."""
    from commonroad.common.file_reader import CommonRoadFileReader
    from commonroad.common.file_writer import CommonRoadFileWriter, OverwriteExistingFile
    from commonroad.common.reader.file_reader_xml import XMLFileReader
    from commonroad.common.util import FileFormat

    from interdrive.batches.job import _AT_HAND, Job, content_of, execute
    from interdrive.files import shipped_scenario

    if not hasattr(CommonRoadFileReader, "open_all"):
        pytest.skip("this commonroad-io has one protobuf file per scenario")
    scenario, problems = XMLFileReader(shipped_scenario("lane_merge")).open()
    writer = CommonRoadFileWriter(scenario, problems, "a", "b", "c", set(), file_format=FileFormat.PROTOBUF)
    name, always = "ZAM_Merge-1_1_T-1", OverwriteExistingFile.ALWAYS
    writer.write_map_to_file(str(tmp_path / "ZAM_Merge-1.pb"), always)
    writer.write_dynamic_to_file(str(tmp_path / f"{name}.pb"), always)
    writer.write_scenario_to_file(str(tmp_path / f"{name}-SC.pb"), always)
    (spec,) = plan((tmp_path,)).specs
    assert spec.scenario == name
    content = content_of(spec)
    assert sorted(content) == ["ZAM_Merge-1.pb", f"{name}-SC.pb", f"{name}.pb"]
    here = execute(Job(spec, "none"), 1)
    assert here.status == "finished", here.error
    road = tmp_path / "ZAM_Merge-1.pb"
    road.write_bytes(road.read_bytes() + b"\x1a\x00")  # an empty field more
    assert plan((tmp_path,)).specs[0].key != spec.key
    road.unlink()
    _AT_HAND.clear()
    there = execute(Job(spec, "none", content), 1)
    assert there.outcomes == here.outcomes


def test_files_that_are_no_scenarios_are_rows_with_their_reason(tmp_path):
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "broken.xml").write_text("<nothing/>")
    (tmp_path / "in" / "empty.xml").write_bytes(b"")
    done = idr.batch([tmp_path / "in", "t_junction"], tmp_path / "out", planner=FAST, workers=1)
    assert done.status == {"refused": 2, "finished": 1}
    rows = [row for row in done.table.to_pylist() if row["status"] == "refused"]
    assert [row["scenario"] for row in rows] == ["broken", "empty"]
    assert all(row["error"] and row["agent_id"] is None and "\n" not in row["error"] for row in rows)


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        ([], "batch: no scenarios"),
        (["nowhere.xml"], "nowhere.xml: no such file"),
        (["empty"], "holds no scenario files"),
        (["t_junction", "--planner", "frenett"], "did you mean frenet?"),
        (["t_junction", "--planner", "frenet,levl=1"], "levl"),
        (["t_junction", "--planner", "frenet,,idm"], "nothing before or after a comma"),
        (["t_junction", "--planner", "idm,idm"], "planner idm is given twice"),
        (["t_junction", "--traffic", "wild"], "expected one of replay, recorded, velocity_adjusting, same"),
        (["t_junction", "--traffic", "recorded"], "no vehicles are left as traffic"),
        (["t_junction", "--agents", "0"], "agents: 0 leaves nobody under test"),
        (["t_junction", "--agents", "-1"], "expected all, reachable or a number of at least 1"),
        (["t_junction", "--seeds", "3"], "a seed chooses a number of agents"),
        (["t_junction", "--seeds", "some"], "--seeds: expected a whole number"),
        (["t_junction", "--workers", "0"], "workers: expected at least 1"),
        (["t_junction", "--run-timeout", "-1"], "run timeout: expected a positive"),
        (["t_junction", "--memory", "much"], "write a size such as 2G"),
        (["t_junction", "--keep", "some"], "expected one of none, failed, all"),
        (["t_junction", "--set", "planner.x=1"], "no such setting"),
        (["t_junction", "--config", "no.toml"], "no such file"),
    ],
)
def test_what_cannot_be_used_is_one_line_before_anything_is_simulated(arguments, line, tmp_path):
    (tmp_path / "empty").mkdir()
    done = interdrive("batch", *arguments, "--out", "out", cwd=tmp_path)
    assert done.returncode == 2
    assert line in done.stderr
    assert done.stderr.count("\n") == 1
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("what", "module", "where"),
    [("planner", "__main__", "a notebook or script"), ("predictor", "test_batches", "a function")],
)
def test_a_class_that_other_processes_do_not_find_is_named_with_what_to_do(what, module, where, tmp_path):
    class Mine:
        def plan(self, view, predictions): ...
        def predict(self, scene): ...

    Mine.__module__ = module
    Mine.__qualname__ = "Mine" if module == "__main__" else Mine.__qualname__
    text = rf"^{what} .*Mine: it is defined in {where}, .* save it in a file mine.py, write {what} mine:Mine$"
    with pytest.raises(idr.InputError, match=text):
        idr.batch("t_junction", tmp_path / "out", **{what: Mine})


def test_ray_that_is_not_installed_is_one_line(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(idr.InterdriveError, match=r"^ray is not installed; pip install interdrive\[ray\]$"):
        idr.batch("t_junction", tmp_path / "out", planner=FAST, ray="auto")
    assert not (tmp_path / "out").exists()


def test_a_folder_with_other_things_is_left_alone(tmp_path):
    (tmp_path / "thesis.txt").write_text("precious")
    done = interdrive("batch", "t_junction", "--out", tmp_path)
    assert done.returncode == 2
    assert "has other contents (thesis.txt)" in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.txt"]


def test_a_folder_that_is_no_batch_or_of_another_format_is_refused(tmp_path):
    with pytest.raises(idr.ResultsError, match="not a batch folder"):
        idr.read_batch(tmp_path)
    with pytest.raises(idr.ResultsError, match="not a batch folder"):
        idr.read_batch(tmp_path / "nowhere")
    (tmp_path / "batch.json").write_text(json.dumps({"format": 1}))
    with pytest.raises(idr.ResultsError, match="format 1, this version of interdrive writes format 6 and reads 5"):
        idr.read_batch(tmp_path)
    with pytest.raises(idr.ResultsError, match="format 1"):
        idr.batch("t_junction", tmp_path, planner=FAST)


def test_damaged_results_are_named(tmp_path, two_planners):
    (tmp_path / "batch.json").write_bytes((two_planners.folder / "batch.json").read_bytes())
    (tmp_path / "results.parquet").write_bytes(b"PAR1 but not really")
    with pytest.raises(idr.ResultsError, match=r"results\.parquet: cannot be read"):
        idr.read_batch(tmp_path)


def test_settings_that_are_not_the_defaults_are_a_column(tmp_path):
    far = bind(SimulationSettings(), {"view.sensor_radius": 90.0})
    done = idr.batch("lane_merge", tmp_path, planner="idm", settings=far, workers=1)
    assert set(done.table["settings"].to_pylist()) == {"view.sensor_radius=90.0"}


def test_a_scenario_without_agents_is_refused_in_the_set_it_was_asked_for(tmp_path):
    empty = tmp_path / "empty.xml"
    text = shipped_scenario("lane_merge").read_text()
    empty.write_text(re.sub(r"<(dynamicObstacle|planningProblem)\b.*?</\1>", "", text, flags=re.DOTALL))
    done = idr.batch(empty, tmp_path / "out", planner="idm", alone=True, workers=1)
    (row,) = done.table.to_pylist()
    assert (row["status"], row["agents"], row["traffic"]) == ("refused", "alone", "recorded")
    assert idr.batch(empty, tmp_path / "out", planner="idm", alone=True, workers=1).found == 1


def test_results_with_other_columns_are_refused(tmp_path, two_planners):

    (tmp_path / "batch.json").write_bytes((two_planners.folder / "batch.json").read_bytes())
    pq.write_table(two_planners.table.drop_columns(["harm"]), tmp_path / "results.parquet")
    with pytest.raises(idr.ResultsError, match="its columns differ from those of this version"):
        idr.read_batch(tmp_path)


def test_a_configuration_file_says_the_same_as_the_command_line(tmp_path):
    (tmp_path / "in").mkdir()
    from interdrive.files import shipped_scenario

    (tmp_path / "in" / "x.xml").write_bytes(shipped_scenario("t_junction").read_bytes())
    (tmp_path / "b.toml").write_text(
        '[batch]\npaths = ["in"]\nplanner = "idm,idm_mobil,time_gap=2.0"\nagents = 2\nseeds = 2\nworkers = 1\n'
        "[planner.idm]\ntime_gap = 1.5\n"
    )
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    done = interdrive("batch", "--config", tmp_path / "b.toml", "--out", tmp_path / "out", cwd=elsewhere)
    assert done.returncode == 0, done.stderr
    assert "4 runs in" in done.stdout
    same = plan(
        (tmp_path / "in",),
        planner="idm,idm_mobil,time_gap=2.0",
        agents=2,
        seeds=2,
        settings=bind(SimulationSettings(), {"planner.idm.time_gap": 1.5}),
    )
    assert {spec.key for spec in same.specs} == set(idr.read_batch(tmp_path / "out")["key"].to_pylist())


def test_the_table_at_the_end_counts_runs_and_outcomes_per_planner(tmp_path):
    done = interdrive("batch", "lane_merge", "--planner", "idm,frenet,level=1", "--out", tmp_path / "out")
    assert done.returncode == 0
    lines = done.stdout.splitlines()
    assert lines[0].split() == ["planner", "runs", "refused", "failed", "agents", "goal", "reached"]
    assert [line.split() for line in lines[1:3]] == [
        ["frenet,level=1", "1", "0", "0", "7", "7"],
        ["idm", "1", "0", "0", "7", "7"],
    ]
    assert Path(lines[-1].removeprefix("results in ")).name == "out"
