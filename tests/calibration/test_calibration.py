"""Calibration: populations are found again, nothing is lost by a kill, and nothing is claimed where it was fitted."""

import json
import tomllib
from dataclasses import replace

import numpy as np
import pyarrow.parquet as pq
import pytest
from windows import window

import interdrive as idr
from interdrive import InputError, ResultsError
from interdrive.calibration.evolution import Evolution
from interdrive.calibration.following import Following, followers
from interdrive.calibration.result import drivers_file
from interdrive.calibration.variables import VARIABLES, population, ranges, values_at
from interdrive.calibration.verdicts import verdict
from interdrive.config.drivers import Drivers, read_drivers
from interdrive.testing import Car, straight_road, world
from interdrive.traffic_realism.jobs import rollout_settings
from interdrive.traffic_realism.persistence import Persistence
from interdrive.traffic_realism.windows import Recording, windows_of

PLANTED = {
    "time_gap.median": 1.4,
    "time_gap.sd": 0.3,
    "minimum_gap.median": 2.0,
    "acceleration.median": 1.0,
    "desired_factor.median": 1.0,
    "desired_factor.sd": 0.1,
    "free_weight.median": 1.0,
    "noise": 0.4,
    "noise_length": 1.5,
    "time_gap_kept": 0.0,
}
QUICK = {"evaluations": 43, "drives": 3, "long": 10.0, "rollouts": 1}


def _driven(n):
    """A motorway on which planted drivers follow each other for 20 s."""
    cars = [Car(101 + i, 30.0 * (i // 2), 3.5 * (i % 2), 20.0 - 3.0 * (i // 2 % 3 == 2)) for i in range(n)]
    scenario = world(straight_road(15.0 * n + 600.0, 2), cars=cars, steps=100, dt=0.2, name="DEU_Motorway-1_1_T-1")
    settings = {"goal.information": "turns", "step.max_steps": 100, "record.violations": False}
    drivers = population("planted", PLANTED)
    run = idr.simulate(scenario, planner={"planner": "idm", "drivers": drivers}, settings=settings, seed=3)
    found = run.states
    states = {"x": found.x, "y": found.y, "orientation": found.orientation, "velocity": found.velocity}
    assert np.isfinite(found.x).all()
    obstacles = scenario.obstacles
    kept = {name: getattr(obstacles, name)[:, : found.x.shape[1]] for name in ("acceleration", "yaw_rate")}
    return replace(scenario, obstacles=replace(obstacles, **kept, **states))


@pytest.fixture(scope="module")
def driven():
    return _driven(24)


@pytest.fixture(scope="module")
def files(driven, tmp_path_factory):
    folder = tmp_path_factory.mktemp("recordings")
    for place in ("DEU_Motorway", "DEU_Bypass"):
        idr.write_scenario(replace(driven, name=f"{place}-1_1_T-1"), folder / f"{place}-1_1_T-1.xml")
    return folder


@pytest.fixture(scope="module")
def found(files, tmp_path_factory):
    out = tmp_path_factory.mktemp("out") / "fit"
    return idr.calibrate(files, "idm", out=out, hold_out=["DEU_Bypass"], licence='free "to use"', **QUICK)


def test_the_search_finds_the_bottom_of_a_narrow_valley():
    scale = 10.0 ** np.arange(5)

    def best(seed):
        search = Evolution(np.full(5, 2.0), 0.5, 10, seed)
        lowest = np.inf
        for _ in range(220):
            values = (scale * (search.ask() - 1.0) ** 2).sum(axis=1)
            lowest = min(lowest, float(values.min()))
            search.tell(values)
        return lowest

    assert best(0) < 1e-8
    assert best(0) == best(0) != best(1)


def test_behind_recorded_leaders_planted_drivers_are_nearer_than_others():
    # Later on nobody knows how fast they wanted to be: that is what they were at first.
    windows = windows_of([Recording("here", _driven(80), ())], horizon=8.0, starts=[0.0])
    settings = rollout_settings(None, "turns")
    vehicles = followers("here", windows, [window.judged for window in windows], settings)
    following = Following(vehicles, 0)
    assert not following.is_noisy

    def objective(**changes):
        return following.objective(population("one", {**PLANTED, **changes}))

    planted = objective()
    for changes in (
        {"time_gap.median": 0.8},
        {"time_gap.median": 2.2},
        {"noise": 0.0},
        {"noise": 0.9},
        {"acceleration.median": 2.5},
        {"desired_factor.median": 1.3},
    ):
        assert objective(**changes) > planted + 0.01, changes


def test_who_is_alone_drives_as_the_law_says(driven):
    windows = windows_of([Recording("here", driven, ())], horizon=8.0, starts=[1.0])
    vehicles = followers("here", windows, [windows[0].judged], rollout_settings(None, "turns"))
    alone = replace(vehicles, gap=np.full_like(vehicles.gap, np.nan), wanted=np.full_like(vehicles.wanted, 30.0))
    same = {name: replace(one, sd=0.0) for name, one in population("same", PLANTED).parameters.items()}
    way, speed = Following(alone, 0).driven(Drivers("same", same))
    first = speed[0, :, 0]
    assert speed[0, :, 1] == pytest.approx(first + 0.2 * (1.0 - (first / 30.0) ** 4), abs=1e-12)
    assert way[0, :, 1] == pytest.approx(0.1 * (first + speed[0, :, 1]), abs=1e-12)


def test_who_has_its_gap_behind_a_recorded_leader_keeps_its_speed_in_the_improved_model(driven):
    windows = windows_of([Recording("here", driven, ())], horizon=8.0, starts=[1.0])
    vehicles = followers("here", windows, [windows[0].judged], rollout_settings(None, "turns"))
    speed = np.full_like(vehicles.gap, 18.0)
    way = np.concatenate((np.zeros((len(speed), 6)), np.cumsum(0.2 * speed, axis=1) - 3.6), axis=1)
    gap = np.full_like(vehicles.gap, 2.0 + 1.5 * 18.0)
    wanted = np.full_like(vehicles.wanted, 20.0)
    steady = replace(vehicles, way=way, speed=speed, gap=gap, leader=speed, wanted=wanted)
    values = {**PLANTED, "time_gap.median": 1.5, "minimum_gap.median": 2.0, "noise": 0.0, "time_gap_kept": 0.0}
    drivers = population("same", {**values, "desired_factor.median": 1.0, "free_weight.median": 1.0})
    alike = replace(drivers, parameters={name: replace(one, sd=0.0) for name, one in drivers.parameters.items()})
    _, kept = Following(steady, 0).driven(replace(alike, improved=1.0))
    assert kept == pytest.approx(18.0, abs=1e-9), "m/s"
    _, lost = Following(steady, 0).driven(alike)
    assert lost[..., -1].max() < 17.5


def _settled(folder):
    """The file of a motorway on which planted drivers have followed each other for a minute, and do so for another."""
    random = np.random.default_rng(3)
    cars = []
    for lane in range(2):
        x = np.concatenate(([0.0], np.cumsum(24.0 + 8.0 * random.random(24))))
        speeds = [17.0] * 24 + [14.0]
        cars += [Car(101 + 100 * lane + i, x[i], 3.5 * lane, speeds[i]) for i in range(25)]
    scenario = world(straight_road(3140.0, 2), cars=cars, steps=600, dt=0.2, name="DEU_Motorway-1_1_T-1")
    settings = {"goal.information": "turns", "step.max_steps": 600, "record.violations": False}
    drivers = population("planted", {**PLANTED, "time_gap.sd": 0.4, "desired_factor.sd": 0.05, "noise": 0.25})
    run = idr.simulate(scenario, planner={"planner": "idm", "drivers": drivers}, settings=settings, seed=3)
    obstacles, found = scenario.obstacles, run.states
    tables = {name: getattr(obstacles, name)[:, : found.x.shape[1]] for name in ("acceleration", "yaw_rate")}
    tables |= {name: getattr(found, name) for name in ("x", "y", "orientation", "velocity")}
    driven = replace(scenario, obstacles=replace(obstacles, **tables))
    path = folder / "DEU_Motorway-1_1_T-1.xml"
    idr.write_scenario(window(driven, 300, found.x.shape[1] - 1, name=path.stem), path)
    return path


@pytest.mark.long
def test_seconds_show_how_planted_drivers_waver_but_not_how_they_differ(tmp_path):
    found = idr.calibrate(_settled(tmp_path), out=tmp_path / "fit", stage="A", evaluations=300, rollouts=1)
    assert found.values["noise"] == pytest.approx(0.25, abs=0.05), "m/s²"
    assert not found.ranges["time_gap.sd"].is_identified
    assert not found.ranges["desired_factor.sd"].is_identified
    assert found.values["time_gap_kept"] > 0.3, "who shows a short headway at the start has a short time gap"


def test_numbers_that_fits_do_not_agree_on_are_not_identified():
    z = np.zeros((40, len(VARIABLES)))
    z[:, 2] = np.linspace(-1.5, 1.5, 40)
    spread = ranges(z, np.ones(40), is_long=False)
    assert spread["time_gap.median"].is_identified
    assert not spread["minimum_gap.median"].is_identified
    assert not spread["time_gap.sd"].is_identified, "a few seconds do not show it"
    assert ranges(z, np.ones(40), is_long=True)["time_gap.sd"].is_identified
    assert not ranges(z[:5], np.ones(5), is_long=True)["time_gap.median"].is_identified, "too few fits"


@pytest.mark.long
def test_the_fit_is_better_than_the_usual_drivers_and_says_where_it_is_from(found):
    rows = [json.loads(line) for line in (found.file.parent / "evaluations.jsonl").read_text().splitlines()]
    in_worlds = [row for row in rows if row["stage"] == "B"]
    best = min(in_worlds, key=lambda row: row["objective"])
    assert found.values == values_at(np.array(best["z"]))
    assert found.objectives["B"] == (in_worlds[0]["objective"], best["objective"])
    assert {"scores", "headway", "collisions"} <= set(found.parts)
    assert (len(in_worlds), len(rows)) == (3, 46)
    file = read_drivers(str(found.file))
    assert file.parameters == found.drivers.parameters
    assert (file.noise, file.planner, file.fitted_on) == (found.values["noise"], "idm", ("DEU_Motorway",))
    assert file.provenance["licence"] == 'free "to use"'
    assert file.provenance["recordings"]["DEU_Motorway"].startswith("1 files, sha256 ")
    assert file.provenance["held_out"] == ["DEU_Bypass"]


def test_what_was_tried_is_a_table_with_units(found):
    table = pq.read_table(found.file.parent / "evaluations.parquet")
    rows = table.to_pylist()
    log = [json.loads(line) for line in (found.file.parent / "evaluations.jsonl").read_text().splitlines()]
    assert [row["objective"] for row in rows] == [line["objective"] for line in log]
    assert {name: rows[-1][name] for name in values_at(np.zeros(len(VARIABLES)))} == values_at(np.array(log[-1]["z"]))
    assert rows[0]["part_places"] == log[0]["parts"]["places"]
    assert rows[0]["part_collisions"] is None, "stage A has none"
    assert {row["stage"] for row in rows} == {"A", "B"}
    assert table.schema.field("noise").metadata[b"unit"] == "m/s²".encode()
    parts = {name for line in log for name in line["parts"]}
    assert {f"part_{name}" for name in parts} <= set(table.schema.names)


@pytest.mark.long
def test_the_drivers_can_be_a_file_of_their_own(files, found, tmp_path):
    options = {"hold_out": ["DEU_Bypass"], "licence": 'free "to use"', **QUICK}
    again = idr.calibrate(files, "idm", out=tmp_path / "mine.toml", **options)
    assert again.file == tmp_path / "mine.toml"
    assert again.file.read_bytes() == found.file.read_bytes()
    assert {one.name for one in (tmp_path / "mine").iterdir()} == {
        "calibration.json",
        "evaluations.jsonl",
        "evaluations.parquet",
    }


def test_it_is_called_realistic_on_no_place_that_it_was_fitted_on(found):
    with pytest.raises(InputError, match="DEU_Motorway: the population was fitted on this place, so it says nothing"):
        found.is_realistic("DEU_Motorway")
    with pytest.raises(InputError, match=r"DEU_Bypass: .* are too few"):
        found.is_realistic("DEU_Bypass")
    with pytest.raises(InputError, match="place Rome: was not measured; there are DEU_Motorway, DEU_Bypass"):
        found.is_realistic("Rome")
    assert str(found.verdicts["DEU_Motorway"]) == "not judged: the population was fitted on this place"


def test_realism_marks_places_that_drivers_were_fitted_on(files, found):
    rows = idr.realism(files, f"idm,drivers={found.file}", rollouts=1, long=0.0, starts=[1.0])
    marked = {row.place: row.is_fitted for row in rows.rows if row.planner.startswith("idm")}
    assert marked == {"all": True, "DEU_Motorway": True, "DEU_Bypass": False}
    assert any("was fitted on DEU_Motorway: there it says nothing" in note for note in rows.notes)


def _row(found, **changes):
    row = next(row for row in found.realism.rows if row.planner == "idm,drivers=calibrated")
    good = {
        "is_claim": True,
        "energy": {1: 0.1, 3: 1.0, 5: 2.4, 8: 5.0},
        "auc": dict.fromkeys(row.auc, 0.6),
        "collisions": 0.1,
        "long_collisions": 0.5,
        "not_admitted": 0.01,
        "persistence": Persistence(0.5, 0.7, 100),
    }
    analog = replace(row, planner="analog", energy={1: 0.1, 3: 1.0, 5: 2.2, 8: 5.0})
    return replace(found.realism, rows=(replace(row, **{**good, **changes}), analog))


def test_verdicts_name_what_is_missed(found):
    def said(**changes):
        return verdict("DEU_Bypass", _row(found, **changes), "idm,drivers=calibrated", ["DEU_Motorway"])

    assert said().is_realistic
    assert str(said()) == "realistic"
    missed = said(long_collisions=2.0, not_admitted=0.05)
    assert missed.is_realistic is False
    assert "collisions per 100 in long drives 2.00, at most 1.00 is asked for" in missed.reasons
    assert "not admitted per 100 5.00, at most 2.00 is asked for" in missed.reasons
    unknown = said(long_collisions=np.nan)
    assert (unknown.is_realistic, unknown.reasons) == (None, ("collisions per 100 in long drives is not known",))


@pytest.mark.long
def test_an_interrupted_calibration_goes_on_with_the_same_bits(files, found, tmp_path):
    folder, whole = tmp_path / "fit", found.file.parent
    folder.mkdir()
    (folder / "calibration.json").write_bytes((whole / "calibration.json").read_bytes())
    log = (whole / "evaluations.jsonl").read_bytes()
    half = len(log) * 2 // 3
    assert log[half - 1] != 10, "cut within a line"
    (folder / "evaluations.jsonl").write_bytes(log[:half])
    options = {"hold_out": ["DEU_Bypass"], "licence": 'free "to use"', **QUICK}
    again = idr.calibrate(files, "idm", out=folder, **options)
    for name in ("calibration.json", "evaluations.jsonl", "drivers.toml"):
        assert (folder / name).read_bytes() == (whole / name).read_bytes(), name
    assert again.rows == found.rows
    with pytest.raises(InputError, match=r"holds another calibration \(seed differ\)"):
        idr.calibrate(files, "idm", out=folder, seed=1, **options)
    (folder / "evaluations.jsonl").write_bytes(log.replace(b"0.0", b"0.5", 1))
    with pytest.raises(ResultsError, match="evaluation 0 is another one"):
        idr.calibrate(files, "idm", out=folder, **options)


def test_files_of_drivers_are_read_as_they_were_written(tmp_path):
    drivers = population("mine", values_at(np.full(len(VARIABLES), 0.3)))
    path = tmp_path / "mine.toml"
    path.write_text(drivers_file(drivers, "idm", {"places": ["A\\B"], "words": 'a "b"\n', "counts": {"A": 3}}))
    assert tomllib.loads(path.read_text())["provenance"]["words"] == 'a "b"\n'
    again = read_drivers(str(path))
    assert again.parameters == drivers.parameters
    assert again.settings("idm", 3, 4) == drivers.settings("idm", 3, 4)
    with pytest.raises(InputError, match="they were fitted for idm; idm, idm_mobil, velocity_adjusting can have them"):
        idr.simulate(world(straight_road(100.0), cars=[Car(11, 0.0, 0.0, 5.0)]), planner=f"rollout,drivers={path}")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"planner": "frenet"}, "planner frenet: cannot be calibrated; idm and idm_mobil can"),
        ({"hold_out": ["Rome"]}, "hold_out: no recording of 'Rome'; there are DEU_Bypass, DEU_Motorway"),
        ({"hold_out": [""]}, "hold_out: no recording of ''; there are DEU_Bypass, DEU_Motorway"),
        ({"hold_out": ["DEU_Bypass", "DEU_Motorway"]}, "every place is held out, so none is left to fit"),
        ({"stage": "C"}, "stage: expected A or B, not 'C'"),
        ({"evaluations": 0}, "evaluations: expected at least 1"),
        ({"drives": 0}, "drives: expected at least 1"),
        ({"rollouts": 0}, "rollouts: expected at least 1"),
        ({"long": 5.0}, "long: expected 0, or at least 10"),
        ({"workers": 0}, "workers: expected at least 1"),
    ],
)
def test_impossible_wishes_are_refused_in_one_line_before_anything_is_written(files, tmp_path, options, words):
    with pytest.raises(InputError, match=words) as caught:
        idr.calibrate(files, out=tmp_path / "fit", **options)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "fit").exists()


def test_a_folder_with_other_contents_is_not_touched(files, tmp_path):
    (tmp_path / "letter.txt").write_text("dear")
    with pytest.raises(InputError, match="is no calibration, and not empty"):
        idr.calibrate(files, out=tmp_path, **QUICK)
    assert [path.name for path in tmp_path.iterdir()] == ["letter.txt"]
