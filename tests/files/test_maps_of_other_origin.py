"""Maps as converters leave them: gaps, overlaps, turned bounds, dangling references, side of driving, no traffic."""

from __future__ import annotations

import commonroad_documents as cr
import numpy as np
import pytest
from click.testing import CliRunner

import interdrive as idr
from interdrive.cli import main
from interdrive.scenario.inspection import inspect
from interdrive.scenario.lanes import driving_side

START = cr.initial(30.0, yawRate=0.0, slipAngle=0.0)


def lane(number, first, last, *, y=0.0, more=""):
    """A lanelet along x, 3.5 m wide."""
    x = np.linspace(first, last, 11).tolist()
    return cr.lanelet(number, left=[(one, y + 1.75) for one in x], right=[(one, y - 1.75) for one in x], more=more)


def towards(x, *, y=0.0):
    """A planning problem from (30, 0) to a place."""
    area = cr.rectangle_at(x, y, length=10, width=3)
    return cr.planning_problem(60, cr.goal(position=area, time=(0, 600)), start=START)


def refers(tag, number):
    return f'<{tag} ref="{number}"/>'


def stop_line(more):
    return f"<stopLine>{cr.point(90, 2)}{cr.point(90, -2)}<lineMarking>solid</lineMarking>{more}</stopLine>"


def map_notes(scenario):
    return "\n".join(inspect(scenario).map_notes)


def checked(tmp_path, text):
    """Exit code and output of `interdrive check`."""
    result = CliRunner().invoke(main, ["check", str(cr.saved(tmp_path, text))])
    return result.exit_code, " ".join(result.output.split())


@pytest.mark.parametrize(("overlap", "said"), [(2.0, "2 m"), (5.0, "5 m"), (12.5, "12.5 m"), (40.0, "40 m")])
def test_agents_drive_on_where_a_lanelet_begins_before_the_end_of_the_one_before_it(read, overlap, said):
    lanelets = lane(1, 0, 100 + overlap, more=refers("successor", 2)) + lane(2, 100, 250)
    scenario = read(cr.document(towards(200.0), lanelets=lanelets))
    assert f"lanelet 2 begins {said} before the end of 1" in map_notes(scenario)
    for planner in ("rollout", "frenet", "idm", "idm_mobil"):
        assert idr.simulate(scenario, agents=[60], planner=planner).outcomes.outcome[0] == "goal_reached", planner


def test_gaps_are_counted_and_the_worst_are_named(read):
    ends = [100.05, 202, 310, 420, 501]
    lanelets = "".join(
        lane(i + 1, 100 * i, end if i == 0 else 100 * i + 90 - i, more=refers("successor", i + 2))
        for i, end in enumerate(ends)
    )
    said = map_notes(read(cr.document(lanelets=lanelets + lane(6, 500, 600))))
    assert "4 links join lanelets whose borders are more than 0.1 m apart: " in said
    assert "5 to 6 (14.0 m), 4 to 5 (13.0 m), 3 to 4 (12.0 m) and 1 more" in said


def test_no_route_leads_over_a_gap_of_more_than_3_m(read, tmp_path):
    text = cr.document(towards(200.0), lanelets=lane(1, 0, 100, more=refers("successor", 2)) + lane(2, 104, 250))
    with pytest.raises(idr.NoRouteError, match="no way leads from lanelet 1 to lanelet 2"):
        idr.simulate(read(text), agents=[60])
    assert "1 to 2 (4.0 m); no route uses the 1 with more than 3 m" in checked(tmp_path, text)[1]


def test_a_goal_behind_the_start_is_called_so(read, tmp_path):
    text = cr.document(towards(10.0))
    with pytest.raises(idr.NoRouteError, match="the goal lies 20 m behind the start in the same lanelet"):
        idr.simulate(read(text), agents=[60])
    assert "the goal lies 20 m behind the start in the same lanelet" in checked(tmp_path, text)[1]


def test_narrow_closed_self_crossing_and_turned_lanelets_are_named(read):
    ring = [(20 * np.cos(a), 20 * np.sin(a)) for a in np.linspace(0, 2 * np.pi, 41)]
    inner = [(0.8 * x, 0.8 * y) for x, y in ring]
    zigzag = [(0, 300), (60, 304), (60, 300), (30, 306)]
    lanelets = (
        cr.lanelet(1, left=((0, 101.4), (100, 101.4)), right=((0, 100), (100, 100)))
        + cr.lanelet(2, left=inner, right=ring)
        + cr.lanelet(3, left=zigzag, right=[(x, y - 3) for x, y in zigzag])
        + cr.lanelet(4, left=((0, 400), (100, 400)), right=((0, 404), (100, 404)))
    )
    said = map_notes(read(cr.document(lanelets=lanelets)))
    assert "2 lanes are narrower than 2 m somewhere, lanelets: 3 (0.00 m), 1 (1.40 m)" in said
    assert "lanelet 2 is closed, its end is its start" in said
    assert "lanelet 3 is self-crossing" in said
    assert "lanelet 4 is turned over: its left bound lies on the right of its right bound" in said


@pytest.mark.parametrize("turned", ["left", "right"])
def test_a_bound_that_runs_against_the_other_is_turned_round(read, turned):
    bounds = {"left": [(0, 2), (50, 2), (100, 2)], "right": [(0, -2), (50, -2), (100, -2)]}
    bounds[turned].reverse()
    scenario = read(cr.document(towards(80.0), lanelets=cr.lanelet(7, **bounds)))
    assert f"bounds in opposite directions, the {turned} one is turned round, lanelets: 7" in scenario.notes
    assert scenario.lanelets.left[0][0].tolist() == [0, 2] and scenario.lanelets.right[0][0].tolist() == [0, -2]
    assert idr.simulate(scenario, agents=[60]).outcomes.outcome[0] == "goal_reached"


def test_bounds_of_bends_and_short_wide_lanelets_are_left_as_they_are(read):
    around = np.linspace(-0.5 * np.pi, np.pi, 31)
    bend = [[(r * np.cos(a), r * np.sin(a)) for a in around] for r in (4.0, 9.0)]
    lanelets = cr.lanelet(1, left=bend[0], right=bend[1])
    lanelets += cr.lanelet(2, left=((50, 10), (50.5, 10)), right=((50, 0), (51, 0)))
    assert not any("turned round" in note for note in read(cr.document(lanelets=lanelets)).notes)


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (refers("trafficLightRef", 901), "lanelet 1 refers to traffic light 901, which does not exist"),
        (refers("trafficSignRef", 902), "lanelet 1 refers to traffic sign 902, which does not exist"),
        (refers("successor", 903), "lanelet 1 refers to successor 903, which does not exist"),
        (refers("predecessor", 904), "lanelet 1 refers to predecessor 904, which does not exist"),
        (
            '<adjacentLeft ref="905" drivingDir="same"/>',
            "lanelet 1 refers to left neighbour 905, which does not exist",
        ),
        (
            '<adjacentRight ref="906" drivingDir="opposite"/>',
            "lanelet 1 refers to right neighbour 906, which does not exist",
        ),
        (
            stop_line(refers("trafficSignRef", 907) + refers("trafficLightRef", 908)),
            "the stop line of lanelet 1 refers to traffic light 908, which does not exist",
        ),
    ],
)
def test_a_reference_to_nothing_is_noted_and_the_agent_drives_on(read, more, said):
    scenario = read(cr.document(towards(80.0), lanelets=cr.lanelet(1, more=more)))
    assert said in scenario.notes
    assert idr.simulate(scenario, agents=[60]).outcomes.outcome[0] == "goal_reached"


def test_incomings_that_refer_to_nothing_are_noted(read):
    incoming = (
        f'<incoming id="20">{refers("incomingLanelet", 1)}{refers("successorsStraight", 99)}{refers("isLeftOf", 21)}'
        "</incoming>"
    )
    notes = read(cr.document(f'<intersection id="10">{incoming}</intersection>')).notes
    assert "incoming 20 of intersection 10 refers to lanelet 99, which does not exist" in notes
    assert "incoming 20 of intersection 10 refers to incoming 21, which does not exist" in notes


def test_many_references_to_nothing_are_counted(read):
    more = "".join(refers("successor", 100 + i) for i in range(8))
    notes = read(cr.document(lanelets=cr.lanelet(1, more=more))).notes
    assert sum("refers to successor" in note for note in notes) == 3
    assert "5 more references to a successor that does not exist" in notes


def test_a_bare_map_is_no_error_of_check(tmp_path):
    code, said = checked(tmp_path, cr.document())
    assert code == 0 and "no traffic: " in said and "error:" not in said


def test_traffic_without_any_agent_is_one(tmp_path):
    walker = cr.car(30, cr.initial(10.0), [cr.state(1, 11.0, orientation=0.0)], kind="pedestrian")
    code, said = checked(tmp_path, cr.document(walker))
    assert code == 2 and "no vehicle can become an agent" in said


def beside(side, kind="urban", limit=None):
    """Two lanes of one direction: 1 of type urban, and 2 on a side of it."""
    y = 3.5 if side == "left" else -3.5
    tag = "adjacentLeft" if side == "left" else "adjacentRight"
    sign = f"<laneletType>{kind}</laneletType>" + ("" if limit is None else refers("trafficSignRef", 70))
    lanelets = lane(1, 0, 100, more=f'<{tag} ref="2" drivingDir="same"/><laneletType>urban</laneletType>')
    lanelets = lanelets.replace("</lanelet>", ("" if limit is None else refers("trafficSignRef", 71)) + "</lanelet>")
    signs = "" if limit is None else cr.speed_sign(70, limit) + cr.speed_sign(71, 20.0)
    return cr.document(signs, lanelets=lanelets + lane(2, 0, 100, y=y, more=sign))


@pytest.mark.parametrize("kind", ["shoulder", "busLane", "sidewalk", "parking", "exitRamp"])
@pytest.mark.parametrize("side", ["left", "right"])
def test_the_side_of_driving_is_that_of_shoulders_and_ramps(read, kind, side):
    scenario = read(beside(side, kind))
    assert driving_side(scenario.lanelets) == side
    assert scenario.priorities.left_hand == (side == "left")


@pytest.mark.parametrize(
    ("side", "limit", "driving"), [("left", 30.0, "right"), ("left", 10.0, "left"), ("right", 30.0, "left")]
)
def test_the_faster_lane_is_on_the_other_side(read, side, limit, driving):
    assert driving_side(read(beside(side, limit=limit)).lanelets) == driving


@pytest.mark.parametrize(("y", "driving"), [(3.5, "right"), (-3.5, "left")])
def test_lanes_of_opposite_directions_tell_by_their_common_bound_alone(read, y, driving):
    back = [(100.0 - 10 * i, y) for i in range(11)]
    opposite = cr.lanelet(2, left=[(x, at - 1.75) for x, at in back], right=[(x, at + 1.75) for x, at in back])
    assert driving_side(read(cr.document(lanelets=lane(1, 0, 100) + opposite)).lanelets) == driving


def test_where_the_map_does_not_tell_the_country_does_and_check_says_so(read):
    for country, side in (("ZAM", "right"), ("GBR", "left")):
        scenario = read(cr.document().replace("ZAM_Test", f"{country}_Test"))
        assert scenario.priorities.left_hand == (side == "left")
        assert (
            f"does not tell on which side vehicles drive: on the {side}, by the country of {country}_Test"
            in map_notes(scenario)
        )
    assert "does not tell" not in map_notes(read(beside("left", "shoulder").replace("ZAM_Test", "DEU_Test")))


def test_an_agent_that_starts_within_a_junction_follows_the_lanelet_that_it_is_on(read):
    """Lanelets 2 (straight on) and 3 (aside) begin at the same place; both lead on to 4, 2 on a longer way."""
    x = np.linspace(0, 60, 31)
    aside = np.column_stack([x, 14.0 * (x / 60) ** 1.3])

    def along(points, number, more):
        points = np.asarray(points, dtype=float)
        ahead = np.gradient(points, axis=0)
        normal = np.column_stack([-ahead[:, 1], ahead[:, 0]]) / np.hypot(*ahead.T)[:, None]
        return cr.lanelet(
            number, left=(points + 1.75 * normal).tolist(), right=(points - 1.75 * normal).tolist(), more=more
        )

    around = [(60, 0), (80, 0), (100, 4), (120, 10), (140, 14), (160, 14)]
    lanelets = (
        along(np.column_stack([x, 0 * x]), 2, refers("successor", 5))
        + along(aside, 3, refers("successor", 6))
        + along(around, 5, refers("successor", 4))
        + along([(60, 14), (110, 14), (160, 14)], 6, refers("successor", 4))
        + along([(160, 14), (200, 14), (260, 14)], 4, "")
    )
    area = cr.rectangle_at(240, 14, length=10, width=3)
    start = cr.initial(6.0, 0.0, yawRate=0.0, slipAngle=0.0)
    scenario = read(
        cr.document(cr.planning_problem(60, cr.goal(position=area, time=(0, 600)), start=start), lanelets=lanelets)
    )
    run = idr.simulate(scenario, agents=[60])
    assert run.agents[0].route_lanelet_ids[0] == 2 and run.outcomes.outcome[0] == "goal_reached"
