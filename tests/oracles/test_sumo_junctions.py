"""Right of way at junctions, as derived from their lanelets, against the matrices of SUMO's netconvert.

Every pair of ways from different arms is compared: whether they share ground, and which of both gives way.
"""

from __future__ import annotations

import itertools

import pytest
from sumo_junctions import MAIN, STOP, YIELD, as_scenario, netconverted

from interdrive.native_settings import RoadSettings
from interdrive.scenario.native import core_road, core_scenario

CROSS, TEE = ("east", "north", "west", "south"), ("east", "north", "west")
THROUGH = ("east", "west")
#: SUMO's type of a junction, the arms with priority, what the signs at these and at the others are worth, lights.
KINDS = {
    "without signs": ("right_before_left", (), None, None, False),
    "main road": ("priority", THROUGH, MAIN, YIELD, False),
    "main road and stop signs": ("priority_stop", THROUGH, MAIN, STOP, False),
    "all-way stop": ("allway_stop", (), STOP, STOP, False),
    "lights": ("traffic_light", (), None, None, True),
}


def decisions(folder, arms, kind, *, left_hand):
    """For each pair of ways: their names, whether they share ground, and which of both gives way, for SUMO and here."""
    sumo_type, main, rank_main, rank_other, lights = KINDS[kind]
    junction = netconverted(folder, arms, sumo_type, main, left_hand)
    by_arm = {arm: rank_main if arm in main else rank_other for arm in arms}
    ranks = {arm: rank for arm, rank in by_arm.items() if rank is not None}
    scenario = as_scenario(junction, ranks, lights=lights, left_hand=left_hand)
    areas = core_scenario(scenario, core_road(scenario, RoadSettings())).junctions()
    ours = {}
    for (a, b), first in zip(areas["lanelet"].tolist(), areas["first"].tolist(), strict=True):
        ours[a - 1, b - 1], ours[b - 1, a - 1] = (first == 1, first == 0), (first == 0, first == 1)
    for (i, a), (j, b) in itertools.combinations(enumerate(junction.connections), 2):
        if a.origin != b.origin and junction.meet[i, j]:
            sumo = (bool(junction.yields[i, j]), bool(junction.yields[j, i])) if junction.foes[i, j] else None
            yield a, b, sumo, ours.get((i, j))


def cross_each_other(a, b, left_hand):
    """Both turn across oncoming traffic, from opposite arms."""
    across = "r" if left_hand else "l"
    return a.turn == b.turn == across and {a.origin, b.origin} in ({"east", "west"}, {"north", "south"})


@pytest.mark.parametrize("left_hand", [False, True], ids=["right-hand", "left-hand"])
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("arms", [CROSS, TEE], ids=["cross", "T"])
def test_ways_share_ground_and_give_way_as_sumo_says(tmp_path, measured, arms, kind, left_hand):
    shared, wrong, ties = 0, [], 0
    for a, b, sumo, ours in decisions(tmp_path, arms, kind, left_hand=left_hand):
        shared += sumo is not None or ours is not None
        # Here the first to arrive goes. In SUMO both give way at an all-way stop, and of two vehicles that turn across
        # each other the one of the later connection does.
        undecided = kind == "all-way stop" or cross_each_other(a, b, left_hand)
        if undecided and sumo is not None and ours == (False, False):
            ties += 1
        elif sumo != ours:
            wrong.append(f"{a.name} and {b.name}: they give way {sumo} in SUMO, {ours} here")
    what = f"{'left' if left_hand else 'right'}-hand {'T' if arms == TEE else 'cross'}, {kind}"
    measured(f"pairs of ways, {what}", shared, len(wrong), 0, "", f"{ties} by arrival" if ties else "", wrong)
