"""Maps of CARLA, esmini and others have the lanes, links and places that independent programs find.

Three programs agree on most of the 760 places; they and their versions: see the folder of the maps.
"""

import gzip
import importlib.util
import json
import time
from collections import Counter
from pathlib import Path
from xml.etree import ElementTree

import foreign_files as ff
import numpy as np
import pytest

import interdrive as idr
from interdrive.files import scenario_document
from interdrive.files.scenario_file import losses
from interdrive.files.sources import Notes, SourceFile
from interdrive.files.sources.opendrive.borders import offsets_at, points_at
from interdrive.files.sources.opendrive.reader import DRIVEN
from interdrive.files.sources.opendrive.records import roads_of
from interdrive.scenario.map_defects import map_defects

ROOT = Path(__file__).resolve().parents[2]
#: Lanelets where they are not the driving lanes: closed lanes are two, those without width or length none.
LANELETS = {"velodrome": 6, "poly3_and_border": 12, "suspect_geometries": 2, "zero_width": 3, "zero_width_lht": 3}
#: Links where they are not all that are stated: borders are up to 3.5 m apart; a ring of two halves has two.
LINKS = {"Town03": 502, "soderleden": 8, "velodrome": 6}
#: One-way roads, or a median between both directions: lanelets do not show on which side vehicles drive.
UNSHOWN = ("e6mini-lht", "highway_split_lht")
MAPS = (
    *("CulDeSac", "DR_DEU_Merging_MT", "MONAEast", "Roundabout8Course", "Town01", "Town03", "Town04", "Town10HD"),
    *("crest-curve", "curves", "direct_junction_simple", "e6mini-lht", "e6mini", "fabriksgatan"),
    *("fabriksgatan_mixed_id_types", "header_offset", "highway_exit", "highway_merge_split", "highway_split_lht"),
    *("junction_unordered", "lane_access_bi", "lane_offset_intersection", "lane_width_and_offset"),
    *("multi_lanesections", "od_merge", "oppositeLaneRoad", "poly3_and_border", "shoulders", "simple_3way_lht"),
    *("simple_4way", "soderleden", "straight_with_speed_limit", "superelevation_curve", "suspect_geometries"),
    *("two_plus_one", "velodrome", "zero_width", "zero_width_lht"),
)


def file_of(folder, name):
    return next((folder / "xodr").glob(f"{name}.xodr*"))


@pytest.fixture(scope="module")
def expected(inputs_folder):
    return json.loads((inputs_folder / "expected_xodr.json").read_text())


def distance(point, line):
    start, step = line[:-1], np.diff(line, axis=0)
    share = np.clip(((point - start) * step).sum(axis=1) / np.maximum((step**2).sum(axis=1), 1e-18), 0.0, 1.0)
    return np.hypot(*(start + share[:, None] * step - point).T).min()


def test_every_map_with_expected_values_is_tested(expected):
    assert sorted(expected) == sorted(MAPS)


@pytest.mark.parametrize("name", MAPS)
def test_a_map_has_its_lanes_links_lengths_and_sides(inputs_folder, expected, name):
    facts = expected[name]
    scenario = idr.read_source(file_of(inputs_folder, name), country="GBR" if name in UNSHOWN else None)
    lanelets = scenario.lanelets
    rows = ff.driven(lanelets)
    assert len(rows) == LANELETS.get(name, facts["driving_lanes"])
    assert sum(map(len, lanelets.successors)) == LINKS.get(name, facts["links"])
    assert scenario.priorities.left_hand == facts["left_hand"]
    middles = [0.5 * (lanelets.left[row] + lanelets.right[row]) for row in rows]
    lengths = [np.hypot(*np.diff(middle, axis=0).T).sum() for middle in middles]
    if not name.startswith("zero_width"):  # one of whose lanes is left out
        assert sum(lengths) == pytest.approx(facts["length_reference"], rel=1e-3, abs=0.1)
    stated = Counter("none" if np.isnan(limit) else f"{limit:.2f}" for limit in lanelets.speed_limit[rows])
    for limit, count in facts["speeds"].items():
        if limit != "none" and name not in LANELETS:
            assert stated[limit] >= count, "lanes of junctions have limits besides the stated ones"


@pytest.mark.long
@pytest.mark.parametrize("name", MAPS)
def test_the_middles_of_lanes_are_where_others_put_them(inputs_folder, expected, name):
    path = file_of(inputs_folder, name)
    file, scenario = SourceFile(path), idr.read_source(path)
    roads = roads_of(file.document(), DRIVEN, str(path), Notes())
    rows = {key: row for row, key in enumerate(scenario.source.keys)}
    lanelets = scenario.lanelets
    for point in expected[name]["points"]:
        road, place = roads[point["road"]], np.array([point["x"], point["y"]])
        index = max(i for i, section in enumerate(road.sections) if section.start <= point["s"])
        section = road.sections[index]
        outer = [lane.number for lane in section.lanes].index(point["lane"])
        inner = outer + 1 if point["lane"] > 0 else outer - 1
        at = points_at(road, offsets_at(road, section, np.array([point["s"]])), np.array([point["s"]]))
        assert np.hypot(*(0.5 * (at[outer, 0] + at[inner, 0]) - place)) < 0.02
        key = f"{point['road']}/{index}/{point['lane']}"
        written = [rows[one] for one in (key, f"{key}+") if one in rows]
        if written:
            middles = [0.5 * (lanelets.left[row] + lanelets.right[row]) for row in written]
            assert min(distance(place, middle) for middle in middles) < 0.05
        else:
            assert name in LANELETS


@pytest.mark.parametrize("name", [*MAPS, "DR_DEU_Merging_MT_shifted"])
def test_check_finds_nothing_but_narrow_lanes(inputs_folder, name):
    scenario = idr.read_source(file_of(inputs_folder, name))
    assert [line for line in map_defects(scenario.lanelets) if "narrower" not in line] == []


@pytest.mark.parametrize("name", ["Town01", "fabriksgatan", "poly3_and_border", "simple_3way_lht", "velodrome"])
def test_a_map_is_read_from_its_commonroad_file_as_the_same(inputs_folder, name):
    scenario = idr.read_source(file_of(inputs_folder, name))
    assert losses(scenario, scenario_document(scenario)) == ()


def test_a_section_ends_before_the_next_offset_begins(inputs_folder):
    scenario = idr.read_source(file_of(inputs_folder, "Town04"))
    row = scenario.source.keys.index("779/0/6")
    ends = 0.5 * (scenario.lanelets.left[row] + scenario.lanelets.right[row])[[0, -1]]
    assert np.hypot(*(ends - (-16.254, 49.115)).T).min() < 0.02


def test_lanes_inside_junctions_of_carla_have_limits(inputs_folder):
    lanelets = idr.read_source(file_of(inputs_folder, "Town03")).lanelets
    limits = lanelets.speed_limit[ff.driven(lanelets)]
    assert Counter(f"{limit:.2f}" for limit in limits) == {"22.35": 229, "24.59": 198, "11.18": 2}


def test_names_of_roads_do_not_matter(inputs_folder):
    one, other = (
        idr.read_source(file_of(inputs_folder, name)).lanelets
        for name in ("fabriksgatan", "fabriksgatan_mixed_id_types")
    )
    turns = [row for row, after in enumerate(one.successors) if len(after) == 1 == len(one.predecessors[row])]
    assert len(turns) >= 12
    assert len(one.ids) == len(other.ids)
    places = [sorted(map(tuple, np.round([left[0] for left in each.left], 3).tolist())) for each in (one, other)]
    assert places[0] == places[1]


@pytest.mark.long
def test_a_town_is_read_in_at_most_eight_times_what_its_xml_takes(inputs_folder):
    path = file_of(inputs_folder, "Town03")
    document = gzip.decompress(path.read_bytes())
    ratio = seconds(lambda: idr.read_source(path)) / seconds(lambda: ElementTree.fromstring(document))
    assert ratio < 8.0, "3 to 4.5; half a second on a quiet machine"


def seconds(call) -> float:
    """Computing time of a call [s], the least of three: load makes it longer, never shorter."""
    times = []
    for _ in range(3):
        begun = time.process_time()
        call()
        times.append(time.process_time() - begun)
    return min(times)


@pytest.mark.long
def test_vehicles_on_real_towns_reach_their_goals_and_none_collides(inputs_folder):
    spec = importlib.util.spec_from_file_location("inputs", ROOT / "benchmarks" / "inputs.py")
    benchmark = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(benchmark)
    outcomes = [
        outcome
        for name in ("Town01", "Town03", "Town04", "Town10HD")
        for outcome in idr.simulate(
            benchmark.with_vehicles(idr.read_source(file_of(inputs_folder, name)), 30, 1), agents="problems"
        ).outcomes.outcome
    ]
    assert len(outcomes) == 120
    assert outcomes.count("collision") == 0
    assert outcomes.count("goal_reached") >= 115
