"""What reference drivers would have avoided: collisions and near misses of runs, in tables and in words."""

import time

import numpy as np
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner
from drivers import Straight

import interdrive as idr
from interdrive.alks import worlds
from interdrive.cli import main
from interdrive.files import write_scenario
from interdrive.panel import counterfactual
from interdrive.reference_drivers import DRIVERS
from interdrive.scoring import preventability, score, score_table
from interdrive.testing import Car, crossing, problem, straight_road, world


def driven(cars, velocity=15.0, lanelets=None, **more):
    """An agent that keeps its speed, whatever is in its way."""
    agent = problem(100, 20.0, velocity=velocity, goal=(360.0, 0.0), time_step=(0, 200), **more)
    scenario = world(lanelets or straight_road(400.0), cars=cars, problems=[agent], steps=200)
    return idr.simulate(scenario, agents="problems", planner=Straight, predictor="constant_velocity", threads=1)


def test_a_slower_leader_is_avoided_by_all_and_the_words_say_so():
    found = preventability(driven([Car(5, 100.0, velocity=8.0)]))
    assert (found.agent_id.tolist(), found.partner_id.tolist(), found.kind) == ([100], [5], ("collision",))
    assert [found.preventable[name].tolist() for name in ("cc", "r157", "rss", "fsm")] == [[1.0]] * 4
    assert np.isnan(found.impact_speed["cc"][0])
    assert found.distance["cc"][0] > 1.0, "m"
    assert found.words[0].startswith("a careful and competent driver (UN R157) would have avoided this collision at ")
    assert "5 was in the agent's way from 0.0 s on, when both were there first, 10.8 s before" in found.words[0]
    assert "braking from 15.0 m/s to" in found.words[0]
    assert found.words[0].endswith("so would r157, rss and fsm")


def test_scores_say_which_drivers_would_have_avoided_a_collision():
    hit = score(driven([Car(5, 100.0, velocity=8.0)]))
    assert [hit.preventable[name].tolist() for name in DRIVERS] == [[1.0]] * 4
    assert score_table(hit)["preventable_fsm"].to_pylist() == [True]
    late = score(driven([Car(5, 32.0)]))
    assert score_table(late)["preventable_cc"].to_pylist() == [False]
    none = score(driven([]))
    assert score_table(none)["preventable_cc"].to_pylist() == [None]


def test_what_stands_behind_the_start_of_the_run_is_hit_by_all():
    # 8 m ahead at 15 m/s: 0.5 s, less than any driver's delay.
    found = preventability(driven([Car(5, 32.0)]))
    assert [found.preventable[name][0] for name in ("cc", "rss", "fsm")] == [0.0, 0.0, 0.0]
    assert found.impact_speed["rss"][0] == pytest.approx(15.0), "m/s"
    assert 14.0 < found.impact_speed["cc"][0] < 15.0, "m/s"
    assert "would not have avoided" in found.words[0]
    assert "; that driver would have hit 5 with 14." in found.words[0]


def test_crossing_traffic_has_no_verdict():
    lanes = crossing()
    car = Car(5, 0.0, -30.0, velocity=10.0, orientation=0.5 * np.pi)
    agent = problem(100, -45.0, velocity=15.0, goal=(90.0, 0.0), time_step=(0, 200))
    scenario = world(lanes, cars=[car], problems=[agent], steps=200)
    run = idr.simulate(scenario, agents="problems", planner=Straight, predictor="constant_velocity", threads=1)
    assert run.outcomes.outcome == ("collision",)
    found = preventability(run)
    assert found.undefined == ("crossing",)
    assert np.isnan(found.preventable["cc"][0])
    assert found.witness(0, "cc") is None
    assert found.words == ("UN R157 has no reference driver for crossing traffic",)


def test_oncoming_traffic_is_not_told_as_crossing():
    towards = Car(5, 200.0, velocity=8.0, orientation=np.pi)
    found = preventability(driven([towards]))
    assert found.undefined == ("oncoming",)
    assert found.words == ("UN R157 has no reference driver for oncoming traffic",)


def test_words_name_the_one_that_left_its_lane_and_drivers_that_differ():
    lanes = straight_road(400.0, lanes=2)
    steered = preventability(driven([Car(5, 24.0, 3.5, velocity=14.9)], lanelets=lanes, orientation=0.05))
    assert steered.entry == ("agent",)
    assert "the agent left its lane into the way of 5 at 2.0 s, 0.2 s before" in steered.words[0]
    assert steered.words[0].endswith("; nor would r157, rss or fsm")
    entered = preventability(driven([Car(5, 40.0, 3.5, velocity=8.0, orientation=-0.2)], lanelets=lanes))
    assert entered.entry == ("partner",)
    assert (
        "5 came into the agent's way at 0.9 s, 1.2 s before; that driver would have hit 5 with 3.6 m/s"
        in entered.words[0]
    )
    assert entered.words[0].endswith("; nor would rss or fsm; r157 would have")


def test_a_near_miss_is_judged_too():
    # The leader leaves the lane before it is reached: its recording ends 0.6 s before the contact.
    found = preventability(driven([Car(5, 100.0, velocity=8.0, last=100)]))
    assert found.kind == ("near_miss",)
    assert found.preventable["cc"].tolist() == [1.0]
    assert "coming so near" in found.words[0]


def test_a_witness_is_the_drive_of_the_driver():
    run = driven([Car(5, 100.0, velocity=8.0)])
    found = preventability(run)
    witness = found.witness(0, "r157")
    start = found.from_time_step[0] - run.states.first_time_step
    row = np.searchsorted(run.states.participant_id, 100)
    assert witness.x[0] == run.states.x[row, start]
    assert witness.velocity[0] == pytest.approx(15.0)
    # 0.35 s of delay take four steps, then 6 m/s²
    assert witness.velocity[:6] == pytest.approx([15.0, 15.0, 15.0, 15.0, 15.0, 14.4])
    with pytest.raises(idr.InputError, match="there is no reference driver me"):
        found.witness(0, "me")


def test_a_counterfactual_is_the_same_run_up_to_a_moment_and_then_the_driver_brakes():
    scenario = idr.shipped_scenario("t_junction")
    run = idr.simulate(scenario, planner="velocity_adjusting", predictor="constant_velocity", threads=1)
    number, at = int(run.agents[0].id), 20
    other = counterfactual(run, number, "cc", at=at, threads=1)
    first, second = run.states, other.states
    same = slice(0, at + 1)
    for name in ("x", "y", "orientation", "velocity"):
        mine, theirs = getattr(first, name)[:, same], getattr(second, name)[:, same]
        assert np.array_equal(mine, theirs, equal_nan=True), name
    assert not np.array_equal(first.x[:, : at + 10], second.x[:, : at + 10], equal_nan=True)
    assert counterfactual(run, number, "cc", at=at, threads=2).digest == other.digest
    assert other.settings["repeatable"] is False, "no settings name a driver that takes over"
    for outside in (-50, 1_000_000):
        with pytest.raises(idr.InputError, match=f"time step {outside} is not one of the run"):
            counterfactual(run, number, at=outside)
    with pytest.raises(idr.InputError, match="has no collision with another participant"):
        counterfactual(run, number)
    with pytest.raises(idr.InputError, match="there is no reference driver me"):
        counterfactual(run, number, "me")


def test_a_counterfactual_of_a_collision_ends_three_seconds_after_it_as_verdicts_do():
    run = driven([Car(5, 100.0, velocity=8.0)])
    found, contact = preventability(run), int(run.outcomes.time_step[0])
    judged = counterfactual(run, 100, trust=True)
    assert judged.states.x.shape[1] == contact + 30 + 1, "steps of 0.1 s, and the first states"
    assert judged.outcomes.outcome == ("running",)
    assert not judged.finished
    start = int(found.from_time_step[0])
    assert judged.notes[0] == (
        f"from {start / 10:.1f} s on the reference driver cc drives agent 100; the run was watched until "
        f"{(contact + 30) / 10:.1f} s"
    )
    whole = counterfactual(run, 100, until=1_000_000, trust=True)
    assert whole.finished
    assert np.array_equal(judged.states.x, whole.states.x[:, : contact + 31], equal_nan=True)
    with pytest.raises(idr.InputError, match=f"until must be after time step {start}, is {start}"):
        counterfactual(run, 100, until=start, trust=True)


def test_a_collision_is_judged_in_milliseconds():
    run = driven([Car(5, 100.0, velocity=8.0)])
    preventability(run)
    begin = time.perf_counter()
    preventability(run)
    assert time.perf_counter() - begin < 0.02, "s; a tenth of that on a quiet machine"


def test_a_run_with_another_driver_takes_a_fifth_of_a_second_at_most():
    run = driven([Car(5, 100.0, velocity=8.0)])
    counterfactual(run, 100, trust=True)
    begin = time.perf_counter()
    counterfactual(run, 100, trust=True)
    assert time.perf_counter() - begin < 0.2, "s for two vehicles; 0.01 s on a quiet machine"


def test_the_command_prints_the_table_and_stores_it(tmp_path):
    folder = tmp_path / "run"
    driven([Car(5, 100.0, velocity=8.0)]).save(folder)
    for arguments, words in (
        (["preventability", str(folder)], "1 collision: a careful and competent driver avoids 1 and hits in 0"),
        (
            ["preventability", str(folder)],
            "agent 100 with 5: a careful and competent driver (UN R157) would have avoided",
        ),
        (["preventability", str(folder), "--csv"], "100,5,collision,"),
        (["explain", str(folder), "100"], "would have avoided this collision"),
        (["score", str(folder)], "agent 100: a careful and competent driver (UN R157) would have avoided"),
    ):
        result = CliRunner().invoke(main, arguments)
        assert result.exit_code == 0
        assert words in " ".join((result.stdout + result.stderr).split())
    drives = pq.read_table(folder / "preventability_drives.parquet").to_pydict()
    witness = preventability(idr.load(folder)).witness(0, "cc")
    assert [x for x, driver in zip(drives["x"], drives["driver"], strict=True) if driver == "cc"] == witness.x.tolist()
    assert set(drives["driver"]) == set(DRIVERS)
    table = pq.read_table(folder / "preventability.parquet")
    assert table.column("preventable_cc").to_pylist() == [True]
    assert table.column("impact_speed_cc").to_pylist() == [None]
    idr.load(folder)


@pytest.mark.long
def test_a_batch_is_judged_by_planner_and_one_broken_run_is_left_out(tmp_path):
    scenario = tmp_path / "late.xml"
    agent = problem(100, 20.0, velocity=15.0, goal=(360.0, 0.0), time_step=(0, 200))
    write_scenario(world(straight_road(400.0), cars=[Car(5, 32.0)], problems=[agent], steps=200), scenario)
    out = tmp_path / "batch"
    idr.batch(scenario, out, planner=["idm", "lawful"], predictor="constant_velocity", workers=1, keep="all")

    def judged(*more):
        result = CliRunner().invoke(main, ["preventability", str(out), *more])
        return result.exit_code, " ".join(result.stdout.split()), " ".join(result.stderr.split())

    code, text, _ = judged("--workers", "1")
    assert code == 0
    assert "idm collisions 1 0 0 0 0 0" in text, "planner, number, no verdict, and what each driver avoids"
    assert "lawful collisions 1 0 0 0 0 0" in text
    _, table, _ = judged("--csv", "--workers", "2")
    assert table.startswith("scenario,planner,seed,run,agent_id,")
    assert ",idm,0," in table
    next((out / "recordings").glob("*/states.parquet")).write_bytes(b"no table")
    code, text, left_out = judged("--workers", "1")
    assert code == 1
    assert left_out.startswith("left out: ")
    assert "states.parquet" in left_out
    assert text.count("collisions 1 0") == 1


@pytest.mark.parametrize("number", [40, pytest.param(400, marks=pytest.mark.long)])
def test_the_careful_driver_has_no_collision_that_it_would_have_avoided(number):
    draw = np.random.default_rng(3)
    collisions = 0
    for _ in range(number):
        velocity = draw.uniform(8.0, 36.0)
        other = max(2.5, velocity * draw.uniform(0.1, 0.9))
        case = {"velocity": velocity, "other_velocity": other, "gap": draw.uniform(2.0, 70.0)}
        tracks = worlds.cut_in({**case, "sideways": draw.uniform(0.3, 1.8)}, 150)
        run = idr.simulate(
            worlds.scenario("cut_in", tracks, velocity),
            agents=[worlds.EGO],
            planner="cc",
            predictor="constant_velocity",
            settings={"view.sensor_radius": 300.0, "step.grace_factor": 1.0},
            threads=1,
        )
        found = preventability(run)
        hits = [row for row, kind in enumerate(found.kind) if kind == "collision"]
        collisions += len(hits)
        assert not any(found.preventable["cc"][row] == 1.0 for row in hits), case
    assert collisions > number // 8
