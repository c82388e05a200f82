"""No file hangs the program, fills the memory or ends in a traceback: a result, or one line with file and element."""

import json
import os
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import commonroad_documents as cr
import numpy as np
import pytest
from commonroad.scenario.scenario import Scenario as CommonRoadScenario
from commonroad_documents import car, document, goal, initial, lanelet, planning_problem, state
from recorded_runs import run_of, written

from interdrive import InputError, Simulation, read_scenario, scenario_from_commonroad, simulate
from interdrive.config.schema import SimulationSettings, StepSettings
from interdrive.native_settings import RoadSettings
from interdrive.scenario import Shape, limits
from interdrive.scenario.native import core_road, core_scenario
from interdrive.testing import Car, straight_road, world

pytestmark = pytest.mark.long

ROOT = Path(__file__).resolve().parents[2]
SCENARIOS = Path(os.environ.get("INTERDRIVE_SCENARIOS", ROOT.parent / "shared" / "scenarios"))
HOSTILE = sorted((SCENARIOS.parent / "robustness").glob("*.xml"))
#: What every command may take: time of the processor [s], memory [MB].
TIME, MEMORY = 2.0, 500
#: Check, run, criticality and report of files and what Python says of them, in one warm process.
#: A line for each file: its results, and the largest memory since the file before it.
COMMANDS = """
import gc, json, re, sys, time
from pathlib import Path
from click.testing import CliRunner
import interdrive, interdrive.criticality, interdrive.report, interdrive.simulation, matplotlib.figure
import commonroad.common.reader.file_reader_xml
from interdrive.cli import main
from interdrive.files import shipped_scenario
def by_command(*words):
    done = CliRunner().invoke(main, words)
    return done.exit_code, done.stderr
def by_python(file):
    try:
        interdrive.simulate(file, threads=1)
    except interdrive.InterdriveError as error:
        return 2, f"error: {error}\\n"
    return 0, ""
def done_with(file, folder):
    steps = {
        "check": lambda: by_command("check", file),
        "run": lambda: by_command("run", file, "--out", folder),
        "criticality of the recording": lambda: by_command("criticality", file, "--out", folder + "-recorded"),
        "python": lambda: by_python(file),
        "criticality": lambda: by_command("criticality", folder),
        "report": lambda: by_command("report", folder),
    }
    codes = {}
    for name, step in steps.items():
        if name in ("criticality", "report") and codes["run"] not in (0, 1):
            continue
        start = time.process_time()
        codes[name], stderr = step()
        yield name, codes[name], stderr, time.process_time() - start
list(done_with(str(shipped_scenario("t_junction")), sys.argv[1] + "/before"))  # fonts, weights: paid for once
for file in sys.argv[2:]:
    gc.collect()
    Path("/proc/self/clear_refs").write_text("5")  # forgets the peak of memory
    results = list(done_with(file, f"{sys.argv[1]}/{Path(file).stem}"))
    peak = re.search(r"VmHWM:\\s+(\\d+)", Path("/proc/self/status").read_text())[1]
    print(json.dumps([results, int(peak) / 1024]), flush=True)
"""
AN_ELEMENT = re.compile(r"(lanelet|obstacle|planning ?problem|traffic ?light|traffic ?sign|time step size|agent)", re.I)

DRIVING = [state(t, 10.0 + t, orientation=0.0, velocity=10.0) for t in range(1, 31)]
CAR = car(30, initial(10.0), DRIVING)


def test_the_folder_of_hostile_files_is_there():
    if not HOSTILE and os.environ.get("CI") != "true":
        pytest.skip(f"no folder robustness beside {SCENARIOS}: INTERDRIVE_SCENARIOS says where it is")
    assert len(HOSTILE) >= 35


@pytest.fixture(scope="module")
def tried(tmp_path_factory):
    """What became of every hostile file, and the folder of their runs."""
    folder = tmp_path_factory.mktemp("made")
    words = [sys.executable, "-c", COMMANDS, str(folder), *map(str, HOSTILE)]
    done = subprocess.run(words, capture_output=True, text=True, check=False, timeout=300)
    lines = done.stdout.splitlines()
    assert done.returncode == 0, (HOSTILE[len(lines)], done.stderr[-2000:])
    return folder, dict(zip(HOSTILE, map(json.loads, lines), strict=True))


@pytest.mark.parametrize("path", HOSTILE, ids=lambda path: path.stem)
def test_a_hostile_file_ends_in_a_result_or_one_line(path, tried):
    folder, (results, memory) = tried[0] / path.stem, tried[1][path]
    assert memory < MEMORY
    codes = {}
    for command, code, stderr, seconds in results:
        codes[command] = code
        assert seconds < TIME, command
        assert code == 0 or (code == 2 and stderr.startswith(f"error: {path}: ")), (command, stderr)
        assert stderr.count("\n") == (1 if code else 0), stderr
        assert code == 0 or AN_ELEMENT.search(stderr.split(f"{path}: ")[1]), stderr
    assert codes["run"] == codes["check"] == codes["python"]
    assert folder.exists() == (codes["run"] == 0)
    if codes["run"] == 0:
        assert set(codes.values()) == {0}
        read_scenario(folder / "scenario.xml")


def refusal(read, text):
    with pytest.raises(InputError) as refused:
        read(text)
    line = str(refused.value)
    assert "test.xml: " in line
    assert "\n" not in line
    return line.split("test.xml: ")[1]


# Cycles


def lanes_in_a_circle(side):
    """Two lanelets, each of which is the other's neighbour on the same side."""
    bounds = [{}, {"left": ((0, 6), (100, 6)), "right": ((0, 2), (100, 2))}]
    return "".join(
        lanelet(
            number, more=f'<adjacent{side} ref="{3 - number}" drivingDir="same"/><trafficLightRef ref="7"/>', **kept
        )
        for number, kept in enumerate(bounds, start=1)
    )


RED = "<cycle><cycleElement><duration>9</duration><color>red</color></cycleElement></cycle>"
LIGHT = '<trafficLight id="7">' + RED + "{}</trafficLight>"


def test_a_circle_of_neighbours_is_refused_where_a_light_has_no_position(read):
    line = refusal(read, document(LIGHT.format(""), lanelets=lanes_in_a_circle("Right")))
    assert line.startswith("lanelet 1 is its own neighbour: adjacentRight leads back to it")


def test_a_circle_of_neighbours_is_read_where_all_lights_have_positions(read):
    light = LIGHT.format(f"<position>{cr.point(100, -2)}</position>")
    assert read(document(light, lanelets=lanes_in_a_circle("Right"))).lanelets.adjacent_right.tolist() == [2, 1]


# Extent


@pytest.mark.parametrize("length", [1e6, 1e8, 9e8])
def test_a_lanelet_longer_than_any_road_is_refused(read, length):
    road = lanelet(4, left=((0, 2), (length, 2)), right=((0, -2), (length, -2)))
    assert refusal(read, document(CAR, lanelets=road)).startswith(f"lanelet 4 is {length:.0f} m long; at most 100000 m")


def test_a_map_over_half_a_continent_is_refused(read):
    far = lanelet(2, left=((2e6, 2), (2e6 + 100, 2)), right=((2e6, -2), (2e6 + 100, -2)))
    assert refusal(read, document(CAR, lanelets=lanelet(1) + far)).startswith("the map extends over 2000100 m")


def test_a_map_with_the_coordinates_of_a_country_is_read(read):
    left, right = ((690_000, 5_335_002), (690_100, 5_335_002)), ((690_000, 5_334_998), (690_100, 5_334_998))
    scenario = read(document(lanelets=lanelet(1, left=left, right=right)))
    core_road(scenario, RoadSettings())


def test_a_lanelet_without_length_is_refused_with_the_name_of_the_file(read):
    point = lanelet(3, left=((0, 2), (0, 2)), right=((0, -2), (0, -2)))
    scenario = read(document(lanelets=point))
    with pytest.raises(InputError, match=r"test\.xml: lanelet 3: its centre line has no length"):
        core_road(scenario, RoadSettings())


def test_a_lanelet_of_too_many_points_is_refused(read):
    x = np.linspace(0.0, 100.0, limits.MOST_POINTS_OF_A_LANELET + 1).tolist()
    road = lanelet(3, left=[(at, 2) for at in x], right=[(at, -2) for at in x])
    assert refusal(read, document(lanelets=road)).startswith("lanelet 3 has 5001 points on a bound; at most 5000")


def test_lanelets_are_looked_at_once_but_refused_each_time(monkeypatch):
    kept = world(straight_road())
    limits.require_scenario(kept, "kept")
    monkeypatch.setattr(limits, "LONGEST_ROADS", 100.0)
    limits.require_scenario(replace(kept), "kept")
    refused = world(straight_road())
    for _ in range(2):
        with pytest.raises(InputError, match="the map has lanelets of 200 m together; at most 100 m"):
            limits.require_scenario(refused, "refused")


@pytest.mark.parametrize(("field", "worst"), [("x", np.inf), ("velocity", 20000.0), ("yaw_rate", -20000.0)])
def test_states_beyond_the_bounds_are_refused_by_name(field, worst):
    made = world(straight_road(), cars=[Car(7, 10.0, velocity=1.0)])
    table = getattr(made.obstacles, field).copy()
    table[0, 3] = worst
    broken = replace(made, obstacles=replace(made.obstacles, **{field: table}))
    name = {"x": "coordinate", "yaw_rate": "yaw rate"}.get(field, field)
    with pytest.raises(InputError, match=f"bad: obstacle 7 has the {name} {worst:g}"):
        limits.require_scenario(broken, "bad")


def test_the_longer_bounds_count_towards_the_length_of_all_lanelets(monkeypatch):
    monkeypatch.setattr(limits, "LONGEST_ROADS", 500.0)
    far = np.linspace(0.0, 100.0, 11)
    zigzag = np.column_stack((far, 2.0 + 100.0 * (np.arange(11) % 2)))  # 1005 m, its right bound 100 m
    plain = np.column_stack((far, np.full(11, -2.0)))
    for left, right in ((zigzag, plain), (plain, zigzag)):
        with pytest.raises(InputError, match="the map has lanelets of 1005 m together; at most 500 m"):
            limits.require_scenario(world(replace(straight_road(), left=(left,), right=(right,))), "zigzag")


def test_a_commonroad_scenario_without_roads_or_dt_is_refused_in_the_same_words():
    with pytest.raises(InputError, match="has no lanelets; a scenario needs a road network"):
        scenario_from_commonroad(CommonRoadScenario(0.1))
    with pytest.raises(InputError, match=r"the time step size \(dt\) is 0; it must be between"):
        scenario_from_commonroad(CommonRoadScenario(0.0))


# Numbers


HUGE = 2**63


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (document(CAR, dt="1e-300"), "time step size (dt) is 1e-300; it must be between 0.001 and 10"),
        (document(CAR, dt="5e-324"), "time step size (dt) is 5e-324; it must be between 0.001 and 10"),
        (document(CAR, dt="1e9"), "time step size (dt) is 1e9; it must be between 0.001 and 10"),
        (document(lanelets=lanelet(HUGE)), f"a <lanelet> has the id {HUGE}"),
        (document(lanelets=lanelet(-1)), "a <lanelet> has the id -1"),
        (document(car("9" * 5000, initial(10.0))), "a <dynamicObstacle> has the id '999"),
        (
            document(lanelets=lanelet(1, more=f'<successor ref="{HUGE}"/>')),
            f"<successor> of lanelet 1 has the id {HUGE}",
        ),
        (document(planning_problem(60, goal(time=(0, HUGE)))), f"planningProblem 60 has the time step {HUGE}"),
        (document(planning_problem(60, goal(), start=initial(5.0, time=HUGE))), "planningProblem 60 has the time step"),
        (document(car(30, initial(0.0, time=-1))), "dynamicObstacle 30 has the time step -1; time steps start at 0"),
        (
            document(CAR + car(31, initial(0.0), [state(3_000_000, 9.0)])),
            "dynamicObstacle 31 has the time step 3000000",
        ),
        (document(car(30, initial(0.0, velocity=1e9))), "dynamicObstacle 30 has the value 1000000000.0 in <velocity>"),
        (document(car(30, initial(0.0, orientation=1e12))), "dynamicObstacle 30 has the orientation 1e+12"),
        (
            document(car(30, initial(0.0), shape=cr.RECTANGLE.replace("4.5", "1e8"))),
            "obstacle 30 has the size 1e+08, which is larger than 100000 m; correct it",
        ),
        (document(car(30, initial(0.0), shape=cr.RECTANGLE.replace("4.5", "1e-9"))), "smaller than 1e-06 m"),
        (document("<a>" * 60 + "</a>" * 60), "elements deep"),
    ],
)
def test_a_number_out_of_bounds_is_named(read, text, words):
    assert words in refusal(read, text)


def test_an_angle_of_many_turns_in_protobuf_is_refused_before_it_is_turned_back(tmp_path):
    from commonroad.common.protobuf.dynamic.commonroad_dynamic_pb2 import CommonRoadDynamic
    from google.protobuf.json_format import ParseDict

    state = {"orientation": {"exact": 1e300}}
    obstacle = {"dynamicObstacleId": 30, "initialState": state}
    message = ParseDict({"dynamicObstacles": [obstacle]}, CommonRoadDynamic(), ignore_unknown_fields=True)
    for name in ("ZAM_Test-1_1_T-1.pb", "ZAM_Test-1.pb"):
        cr.saved(tmp_path, message.SerializePartialToString() if name.count("_") > 1 else b"", name)
    with pytest.raises(InputError, match=r"1_1_T-1\.pb: dynamic obstacle 30 has the orientation 1e"):
        read_scenario(tmp_path / "ZAM_Test-1_1_T-1.pb")


def test_few_states_far_apart_do_not_make_a_large_table(read):
    far = [car(i, initial(0.0), [state(99_999, 9.0, orientation=0.0)]) for i in range(30, 40)]
    assert refusal(read, document("".join(far))).startswith("obstacle 30 has the time step 99999, with 10 obstacles")


def test_a_scenario_from_memory_keeps_the_same_bounds():
    left, right = (np.array([[0.0, y], [3e6, y]]) for y in (2.0, -2.0))
    endless = world(replace(straight_road(), left=(left,), right=(right,)))
    with pytest.raises(InputError, match="lanelet 1 is 3000000 m long"):
        Simulation(endless)


def test_what_is_derived_from_a_jump_keeps_within_the_bounds(read, tmp_path):
    jumping = [state(t, 4e4 * t, orientation=0.0) for t in (1, 2)]
    scenario = read(document(car(30, initial(0.0, velocity=None), jumping)))
    assert scenario.obstacles.velocity.max() == limits.LARGEST_VELOCITY
    written(run_of(scenario), tmp_path)


def test_a_recording_through_which_no_path_can_lead_is_refused_with_the_obstacle(read):
    away = document(car(30, initial(0.0), [state(1, 1e6, orientation=0.0)]))
    message = "obstacle 30 travels 1000000 m; at most 100000 are possible, correct its positions"
    assert refusal(read, away) == message


# Runs without end


BLOCKED = document(
    f'<staticObstacle id="9"><type>parkedVehicle</type><shape>{cr.RECTANGLE}</shape>{initial(60.0)}</staticObstacle>'
    + planning_problem(60, goal(position=cr.rectangle_at(90, 0, length=10, width=4), time=(0, 2**31 - 1)))
)


def test_a_run_ends_after_its_largest_number_of_steps_and_says_so(read):
    run = simulate(read(BLOCKED), settings=SimulationSettings(step=StepSettings(max_steps=40)))
    assert (run.outcomes.outcome, run.outcomes.time_step.tolist()) == (("time_limit",), [40])
    assert run.states.n_steps == 41
    assert run.finished
    assert (
        run.notes[0] == "the run ended after 40 time steps (step.max_steps) while these agents were still driving: 60"
    )


def test_a_vehicle_that_starts_after_the_last_step_is_no_agent(read):
    late = planning_problem(60, goal(time=(0, 2000)), start=initial(5.0, time=500, yawRate=0.0, slipAngle=0.0))
    settings = SimulationSettings(step=StepSettings(max_steps=400))
    run = simulate(read(document(CAR + late)), settings=settings)
    assert run.outcomes.agent_id.tolist() == [30]
    assert "agent 60: starts at time step 500, but runs end after 400 (step.max_steps); it is left out" in run.notes


# Accepted, saved, accepted


FOOTPRINTS = {
    "tiny": "<circle><radius>0.000002</radius></circle>",
    "thin": cr.rectangle_at(0, 0, length=4, width=0.000001),
    "off its origin and tiny": cr.rectangle_at(1e-9, -1e-9, length=2e-6, width=1e-6, orientation=0.1),
    "large": cr.rectangle_at(0, 0, length=99_999, width=1),
    "many digits": "<circle><radius>1.23456789012345678</radius></circle>",
    "parts": cr.RECTANGLE + "<circle><radius>0.00001</radius><center><x>2</x><y>0</y></center></circle>",
    "triangle": "<polygon>" + cr.point(0, 0) + cr.point(1e-5, 0) + cr.point(0, 1e-5) + "</polygon>",
}


@pytest.mark.parametrize("shape", FOOTPRINTS.values(), ids=FOOTPRINTS)
def test_every_footprint_that_is_read_is_written_such_that_it_is_read(read, tmp_path, shape):
    before = read(document(car(30, initial(10.0), DRIVING, shape=shape)))
    core_scenario(before, core_road(before, RoadSettings()))
    after = written(run_of(before), tmp_path)
    core_scenario(after, core_road(after, RoadSettings()))


@pytest.mark.parametrize(
    "text",
    [
        document(CAR + planning_problem(60, goal(orientation=(4e-9, 6.283185311), velocity=(1e-9, 2e-9)))),
        document(CAR + car(limits.LARGEST_ID, initial(50.0)) + planning_problem(30, goal()), dt="0.033333333333"),
        document(CAR, lanelets=lanelet(30) + lanelet(limits.LARGEST_ID)).replace('Obstacle id="30"', 'Obstacle id="0"'),
        document(CAR).replace("<urban/>", '<a:b xmlns:a="c"/><urban/>'),
        document(
            "<location><country>DEU</country></location>",
            version="2018b",
            lanelets=lanelet(limits.LARGEST_ID, more="<speedLimit>13.5</speedLimit>"),
        ).replace('tags="urban"', 'tags="urban 1&lt;2"'),
        document(version="2018b", lanelets=lanelet(1, more='<predecessor ref="5"/><speedLimit>13.5</speedLimit>')),
    ],
    ids=["intervals", "largest ids", "an id of the road", "tags of others", "2018b", "a map that was cut out"],
)
def test_every_document_that_is_read_is_written_such_that_it_is_read(read, tmp_path, text):
    before = read(text)
    after = written(run_of(before), tmp_path)
    assert len(after.obstacles.ids) == len(before.obstacles.ids)
    assert len(after.planning_problems) == len(before.planning_problems)


def test_every_recorded_scenario_is_written_such_that_it_is_read(recorded_scenarios, tmp_path):
    for scenario in recorded_scenarios.values():
        if not isinstance(scenario, InputError):
            after = written(run_of(scenario), tmp_path)
            assert after.obstacles.ids.size == scenario.obstacles.ids.size, scenario.name


@pytest.mark.parametrize(("n", "accepted"), [(1000, True), (1001, False)])
def test_a_footprint_has_at_most_1000_vertices(read, n, accepted):
    angle = np.linspace(0.0, 2.0 * np.pi, n, endpoint=False)
    corners = "".join(cr.point(2.0 * np.cos(a), np.sin(a)) for a in angle.tolist())
    text = cr.document(cr.car(30, cr.initial(5.0), shape=f"<polygon>{corners}</polygon>"))
    if accepted:
        assert len(read(text).obstacles.shapes[0].vertices) == n
    else:
        with pytest.raises(InputError, match=r"test\.xml: the shape of obstacle 30 has 1001 vertices; at most 1000"):
            read(text)


def test_the_parts_of_a_footprint_have_at_most_1000_vertices_together():
    angle = np.linspace(0.0, 2.0 * np.pi, 501, endpoint=False)
    part = Shape("polygon", vertices=np.column_stack((2.0 * np.cos(angle), np.sin(angle))))
    limits.require_footprint(Shape("group", members=(part,)), "obstacle 30", "two parts")
    with pytest.raises(InputError, match=r"two parts: the shape of obstacle 30 has 1002 vertices; at most 1000"):
        limits.require_footprint(Shape("group", members=(part, part)), "obstacle 30", "two parts")


def test_the_number_of_a_place_may_be_any_that_protobuf_holds(read):
    place = "<location><geoNameId>2147483647</geoNameId><gpsLatitude>0</gpsLatitude><gpsLongitude>0</gpsLongitude>"
    text = document(car(30, initial(5.0)), lanelets=f"{place}</location>{lanelet(1)}")
    assert read(text).obstacles.ids.tolist() == [30]


def test_a_refusal_is_one_line_whatever_the_document_says(read):
    text = document(CAR).replace('<lanelet id="1">', '<lanelet id="&#9;&#10;">')
    with pytest.raises(InputError, match=r"a <lanelet> has the id '\\t\\n'; it must be a whole number$"):
        read(text)


def test_an_area_without_any_shape_is_refused():
    from types import SimpleNamespace

    from interdrive.files.convert import _area

    with pytest.raises(InputError, match="mutant: obstacle 7 has a state whose position is an area without any shape"):
        _area(SimpleNamespace(occupancies=[]), "obstacle 7 has a state whose position is", "mutant")
