"""Protobuf is read as the same document in XML: what it may lack, which signs it has, and what is said of mistakes."""

from __future__ import annotations

import copy
import math
import re

import pytest
from commonroad.common.file_writer import CommonRoadFileWriter, OverwriteExistingFile
from commonroad.common.protobuf.common.traffic_sign_element_pb2 import TrafficSignIDEnum
from commonroad.common.protobuf.dynamic.commonroad_dynamic_pb2 import CommonRoadDynamic
from commonroad.common.protobuf.map.commonroad_map_pb2 import CommonRoadMap
from commonroad.common.protobuf.scenario.commonroad_scenario_pb2 import CommonRoadScenario
from commonroad.common.reader.file_reader_xml import XMLFileReader
from commonroad.common.util import FileFormat
from commonroad.scenario.traffic_sign import TrafficSignIDCountries
from test_messages import DOCUMENT_2020A, INTERNAL, OCCUPIED, UNCERTAIN, state

from interdrive import InputError, read_scenario
from interdrive.files.read import quiet

NAME, ROADS = "DEU_Test-1_1_T-1", "DEU_Test-1.pb"
TRAFFIC, PROBLEMS = f"{NAME}.pb", f"{NAME}-SC.pb"
KINDS = {ROADS: CommonRoadMap, TRAFFIC: CommonRoadDynamic, PROBLEMS: CommonRoadScenario}
PLACE = "<location><geoNameId>1</geoNameId><gpsLatitude>1</gpsLatitude><gpsLongitude>1</gpsLongitude></location>"
DOCUMENT = (
    DOCUMENT_2020A.replace("<lanelet id", f"{PLACE}<scenarioTags/><lanelet id", 1)
    .replace(OCCUPIED, f"<trajectory>{state('state', 1, 1.5)}</trajectory>")
    .replace(UNCERTAIN, state("state", 1, 31))
    .replace("<duration>10</duration><color>red", "<duration>10</duration><color>green")
)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """The messages of the document as commonroad-io writes it, by file."""
    folder = tmp_path_factory.mktemp("written")
    with quiet("document"):
        scenario, problems = XMLFileReader(DOCUMENT.encode()).open()
        writer = CommonRoadFileWriter(scenario, problems, "a", "b", "c", set(), file_format=FileFormat.PROTOBUF)
        writer.write_map_to_file(str(folder / ROADS), OverwriteExistingFile.ALWAYS)
        writer.write_dynamic_to_file(str(folder / TRAFFIC), OverwriteExistingFile.ALWAYS)
        writer.write_scenario_to_file(str(folder / PROBLEMS), OverwriteExistingFile.ALWAYS)
    return {name: kind.FromString((folder / name).read_bytes()) for name, kind in KINDS.items()}


@pytest.fixture
def read(tmp_path, written):
    def changed(change=None, of=None):
        messages = copy.deepcopy(written)
        if change is not None:
            change(messages[of])
        for name, message in messages.items():
            (tmp_path / name).write_bytes(message.SerializePartialToString())
        return read_scenario(tmp_path / TRAFFIC)

    return changed


def goal_heading(first, last):
    def change(problems):
        heading = problems.planning_problems[0].goal_states[0].state.orientation.interval
        heading.start, heading.end = first, last

    return change


@pytest.mark.parametrize("ends", [(-math.pi, math.pi), (0.0, 2.0 * math.pi), (-10.0, 10.0)])
def test_a_goal_of_a_full_turn_of_headings_is_any_heading(read, ends):
    goal = read(goal_heading(*ends), PROBLEMS).planning_problems[0].goal[0]
    assert (goal.orientation, goal.lanelet_ids) == (None, (2,))


def test_a_goal_of_half_a_turn_is_kept(read):
    goal = read(goal_heading(-1.5, 1.6), PROBLEMS).planning_problems[0].goal[0]
    assert goal.orientation == pytest.approx((-1.5, 1.6))


def test_a_planning_problem_that_starts_with_any_heading_is_refused_by_name(read):
    def change(problems):
        heading = problems.planning_problems[0].initial_state.orientation.interval
        heading.start, heading.end = -math.pi, math.pi

    with pytest.raises(InputError, match=r"-SC\.pb: planning problem 50 starts with any heading; state one"):
        read(change, PROBLEMS)


def test_a_vehicle_recorded_with_any_heading_has_that_of_its_motion(read):
    def change(traffic):
        heading = traffic.dynamic_obstacles[0].trajectory_prediction.trajectory.states[0].orientation.interval
        heading.start, heading.end = -4.0, 4.0

    obstacles = read(change, TRAFFIC).obstacles
    assert obstacles.orientation[obstacles.ids.tolist().index(41), 1] == pytest.approx(0.0)


@pytest.mark.parametrize(
    ("change", "note"),
    [
        (lambda traffic: traffic.ClearField("traffic_light_cycle"), "traffic lights without a cycle are dark: 21"),
        (
            lambda traffic: traffic.traffic_light_cycle[0].ClearField("cycle_elements"),
            "traffic lights without a cycle are dark: 21",
        ),
        (
            lambda traffic: setattr(traffic.traffic_light_cycle[0].cycle_elements[0], "duration", 0),
            "phases without a positive duration left out, traffic lights: 21",
        ),
        (
            lambda traffic: setattr(traffic.traffic_light_cycle[0], "active", False),
            "traffic lights that are switched off are dark: 21",
        ),
        (
            lambda traffic: setattr(traffic.traffic_light_cycle[0], "traffic_light_id", 99),
            "a cycle is for traffic light 99, which does not exist",
        ),
    ],
)
def test_a_light_that_cannot_work_is_dark_and_noted(read, change, note):
    scenario = read(change, TRAFFIC)
    assert note in scenario.notes
    assert scenario.traffic_lights[0].phases == ()


@pytest.mark.parametrize("country", [*sorted(TrafficSignIDCountries), "GBR"])
def test_every_sign_of_every_country_is_read(read, country):
    known = [one.name for one in TrafficSignIDCountries.get(country, ())]
    names = [name for name in known if name in TrafficSignIDEnum.TrafficSignID.keys()]  # noqa: SIM118 - no mapping

    def change(roads):
        roads.map_meta_information.map_id.country_id = country
        first = roads.traffic_signs[0]
        for number, name in enumerate(names):
            other = roads.traffic_signs.add()
            other.CopyFrom(first)
            other.traffic_sign_id = 1000 + number
            other.traffic_sign_elements[0].element_id = TrafficSignIDEnum.TrafficSignID.Value(name)

    assert read(change, ROADS).lanelets.speed_limit[0] == 13.9


def test_a_sign_of_another_country_is_not_obeyed(read):
    def change(roads):
        roads.map_meta_information.map_id.country_id = "CHN"
        roads.traffic_signs[0].traffic_sign_elements[0].element_id = TrafficSignIDEnum.TrafficSignID.Value("STOP")

    scenario = read(change, ROADS)
    assert math.isnan(scenario.lanelets.speed_limit[0])
    assert any("1 traffic sign is not obeyed" in note for note in scenario.notes)


def broken(message):
    """Each field dropped, and each part emptied, with what was done."""
    for path in _paths(message):
        for is_emptied in (False, True):
            changed = copy.deepcopy(message)
            owner = changed
            for name, index in path[:-1]:
                owner = getattr(owner, name) if index is None else getattr(owner, name)[index]
            name, index = path[-1]
            if is_emptied:
                part = getattr(owner, name) if index is None else getattr(owner, name)[index]
                if not hasattr(part, "ListFields"):
                    continue
                part.Clear()
                if index is None:
                    part.SetInParent()
            elif index is None:
                owner.ClearField(name)
            else:
                del getattr(owner, name)[index]
            yield f"{'empty' if is_emptied else 'without'} {path}", changed


def _paths(message, before=()):
    for field, value in message.ListFields():
        if hasattr(value, "ListFields"):
            parts = [(None, value)]
        elif isinstance(value, int | float | str) or not hasattr(value[0], "ListFields"):
            yield (*before, (field.name, None))
            continue
        else:
            parts = list(enumerate(value))
        for index, part in parts:
            yield (*before, (field.name, index))
            yield from _paths(part, (*before, (field.name, index)))


@pytest.mark.parametrize("file", KINDS)
def test_messages_name_file_and_element_and_nothing_of_python(tmp_path, written, file):
    for name, message in written.items():
        (tmp_path / name).write_bytes(message.SerializeToString())
    refused = 0
    for what, message in broken(written[file]):
        (tmp_path / file).write_bytes(message.SerializePartialToString())
        try:
            read_scenario(tmp_path / TRAFFIC)
        except InputError as error:
            refused += 1
            text = str(error).removeprefix(f"{tmp_path}/")
            assert text.startswith((f"{file}: ", f"{TRAFFIC}: ")), what
            text = text.partition(": ")[2]
            assert not INTERNAL.search(text), f"{what}: {text}"
            assert re.search(r"\d|lacks \w+|lanelets|[Pp]rediction id", text), f"{what}: {text}"
    assert refused > 20
