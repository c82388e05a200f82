"""Generated traffic on many maps: nobody enters into trouble, and nobody drives into the vehicle ahead."""

import random
from dataclasses import dataclass, replace

import numpy as np
import pytest
from appearances import along_and_aside, too_near

import interdrive as idr
from interdrive.run.assemble import recorded_traffic
from interdrive.testing import Car, straight_road, world

FAST = {"record.violations": False, "record.orders": False}
#: Braking that nobody has to exceed because of an entry [m/s²], and for how long an entry may be to blame [s].
FIRM, SOON = 4.0, 2.0
#: Defective maps that have no lane by which traffic could enter, and files without a road.
NO_ENTRY = ("leads out of it", "has no lanelets", "has no open lanelet")


@dataclass
class Trouble:
    """What is wrong on a map; vehicles by id."""

    hard_entries: list[tuple[int, float]]
    early_contacts: list[int]
    same_lane_contacts: list[tuple[int, int]]
    crossing_contacts: list[tuple[int, int]]
    vehicles: int


def driven(file, seed, seconds):
    """A run of generated traffic on a map; None where nothing can enter."""
    try:
        return idr.simulate(
            file,
            agents=0,
            traffic=f"idm,rate=600,duration={seconds}",
            predictor="lane_following",
            settings=FAST,
            seed=seed,
            threads=1,
        )
    except idr.InputError as error:
        assert any(words in str(error) for words in NO_ENTRY), f"{file.name}: {error}"
        return None


def judged(run):
    states, dt = run.states, run.scenario.dt
    entered = dict(zip(run.demand.agent_id.tolist(), run.demand.entered.tolist(), strict=True))
    due = dict(zip(run.demand.agent_id.tolist(), run.demand.due.tolist(), strict=True))
    found = Trouble([], [], [], [], len(run.agents))
    row_of = {number: row for row, number in enumerate(states.participant_id.tolist())}
    for number, time in entered.items():
        if time > 0.0 and due[number] == due[number]:
            at = round(time / dt) - states.first_time_step
            needed, behind = needed_braking(states, row_of[number], at)
            braking = -states.acceleration[behind, at : at + round(SOON / dt)]
            if needed > FIRM + 0.01 and np.nanmax(braking) > FIRM:
                found.hard_entries.append((number, round(float(needed), 2)))
    ended = run.outcomes
    rows = zip(ended.agent_id.tolist(), ended.partner_id.tolist(), ended.outcome, ended.time_step.tolist(), strict=True)
    for number, partner, outcome, step in rows:
        if outcome != "collision" or partner not in entered:
            continue
        since = [step * dt - entered[one] for one in (number, partner) if due[one] == due[one]]
        if since and min(since) < SOON:
            found.early_contacts.append(number)
        at = step - states.first_time_step
        if in_one_lane(states, row_of[number], row_of[partner], at, round(SOON / dt)):
            found.same_lane_contacts.append((number, partner))
        else:
            found.crossing_contacts.append((number, partner))
    return found


def needed_braking(states, row, at):
    """Braking that a vehicle needs when it enters, or the one behind it [m/s²], and the row of which of them."""
    worst = 0.0, row
    for other in np.flatnonzero(states.valid[:, at]).tolist():
        if other == row:
            continue
        along, aside, turn = along_and_aside(states, row, other, at)
        if abs(aside) > 1.5 or abs(turn) > 0.3 or abs(along) > 100.0:
            continue
        gap = abs(along) - 0.5 * (states.length[row] + states.length[other])
        ahead, behind = (other, row) if along > 0.0 else (row, other)
        fast, slow = states.velocity[behind, at], states.velocity[ahead, at]
        if fast > slow:
            worst = max(worst, ((fast**2 - slow**2) / (2.0 * max(gap, 0.1)), behind))
    return worst


def in_one_lane(states, one, other, at, steps):
    """Whether one of two vehicles has followed the other for some time."""
    for now in range(max(0, at - steps), at):
        if not (states.valid[one, now] and states.valid[other, now]):
            return False
        _, aside, turn = along_and_aside(states, one, other, now)
        if abs(aside) > 1.2 or abs(turn) > 0.3:
            return False
    return True


def check(drives, seconds):
    vehicles, crossing, hard, maps = 0, [], [], 0
    for file, seed in drives:
        run = driven(file, seed, seconds)
        if run is None:
            continue
        found = judged(run)
        where = f"{file.name}, seed {seed}: {found}"
        hard += [(file.name, seed, *entry) for entry in found.hard_entries]
        assert not too_near(run.states), where
        assert not found.early_contacts, where
        assert not found.same_lane_contacts, where
        vehicles, maps = vehicles + found.vehicles, maps + 1
        crossing += [(file.name, *pair) for pair in found.crossing_contacts]
    assert not hard, hard
    # `idm` follows; whom it meets at an angle it sees only where rules say who goes first.
    assert len(crossing) <= 0.01 * vehicles, crossing
    return maps, vehicles, len(crossing)


def road_of(file):
    """What tells a road from others; the file itself where it cannot be read."""
    try:
        lanelets = idr.read_scenario(file).lanelets
    except idr.InputError:
        return str(file)
    return b"".join(np.round(points, 3).tobytes() for side in (lanelets.left, lanelets.right) for points in side)


def test_a_judge_of_entries_finds_what_is_wrong():
    run = idr.simulate(
        "highway", agents=0, traffic="idm,rate=900,duration=8", predictor="lane_following", settings=FAST, threads=1
    )
    assert not judged(run).hard_entries
    entered = run.demand.agent_id[~np.isnan(run.demand.due) & (run.demand.entered > 0.0)]
    row = int(np.searchsorted(run.states.participant_id, entered[-1]))
    at = int(run.states.valid[row].argmax())
    velocity, acceleration = run.states.velocity.copy(), run.states.acceleration.copy()
    velocity[row, at], acceleration[row, at + 3] = 60.0, -6.0
    run = replace(run, states=replace(run.states, velocity=velocity, acceleration=acceleration))
    assert [number for number, _ in judged(run).hard_entries] == [int(entered[-1])]


def test_who_appears_right_ahead_of_another_one_is_found():
    # 10 m/s: 12.5 m to brake, and 2 m; from centre to centre a length of 4.5 m more.
    for ahead, is_found in ((18.0, True), (20.0, False)):
        cars = [Car(1, 20.0, velocity=10.0), Car(2, 30.0 + ahead, velocity=10.0, first=10)]
        scenario = world(straight_road(400.0, 1), cars=cars, steps=30)
        assert bool(too_near(recorded_traffic(scenario).states)) == is_found


def test_on_a_sample_of_maps_nobody_has_to_brake_hard_for_an_entry(scenarios_folder):
    files = sorted(scenarios_folder.rglob("*.xml"))
    random.Random(5).shuffle(files)
    maps, vehicles, _ = check([(file, 1) for file in files[:6]], seconds=15)
    assert maps >= 4
    assert vehicles > 60


@pytest.mark.recorded
def test_on_every_third_road_nobody_has_to_brake_hard_for_an_entry(scenarios_folder):
    """Each road with one of three seeds: recordings of one place have the same road, and generated traffic is alone."""
    by_road = {road_of(file): file for file in sorted(scenarios_folder.rglob("*.xml"))}
    files = sorted(by_road.values())[::3]
    maps, _, _ = check([(file, 1 + place % 3) for place, file in enumerate(files)], seconds=20)
    assert maps > 0.8 * len(files)
