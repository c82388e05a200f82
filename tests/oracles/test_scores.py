"""Scores against their definitions written out with scipy, shapely and numpy, on recorded drives.

Contacts come from recordings, too: one vehicle is moved in time, so that it meets others where it did not.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
import shapely
from scipy.signal import savgol_filter
from score_definitions import Body, Lanes, first_true, judgement, rectangle, turned

from interdrive import _core
from interdrive.native_settings import RoadSettings
from interdrive.scenario.native import core_road
from interdrive.scoring.drives import Site, along, motion_of, rear_axle_to_center, traffic
from interdrive.scoring.settings import ComfortBounds
from interdrive.scoring.smoothing import smoothed
from interdrive.scoring.terms import Motion, comfort_term, direction_term, speed_term

#: So many moments, drives and moved vehicles of each scenario are compared.
MOMENTS, DRIVES, MOVED = 16, 6, 30
#: Points closer to a border than this are under a lanelet or not by rounding [m].
BORDER = 1e-6
HORIZON = 3.0


def site_of(scenario):
    road = core_road(scenario, RoadSettings())
    return Site(scenario, RoadSettings(), road, _core.crossing_lanelets(road, 0.3, 0.1))


def rectangles(scenario):
    """Rows of moving participants whose footprint is a rectangle around their position."""
    shapes = scenario.obstacles.shapes
    return [
        row
        for row in range(len(shapes))
        if shapes[row].kind == "rectangle" and not scenario.obstacles.is_static[row] and not any(shapes[row].center)
    ]


def drives(scenario, n, seed):
    """Some recorded drives of at least 3 states, in one piece."""
    obstacles, found = scenario.obstacles, []
    for row in np.random.default_rng(seed).permutation(rectangles(scenario)).tolist():
        columns = np.flatnonzero(obstacles.valid[row])
        if len(columns) >= 3 and np.ptp(columns) == len(columns) - 1:
            found.append((row, motion_of(obstacles, row, columns, 0)))
    return found[:n]


@pytest.mark.parametrize("n", [3, 4, 7, 8, 15, 16, 60])
def test_filters_are_those_of_savitzky_and_golay(n, measured):
    values = np.random.default_rng(n).normal(size=n)
    largest = 0.0
    for window in (7, 15):
        size = min(window, n if n % 2 else n - 1)
        for derivative in (0, 1, 2):
            expected = savgol_filter(values, size, 2, deriv=derivative, delta=0.1)
            deviation = np.abs(smoothed(values, window, 0.1, derivative) - expected) / max(1.0, np.abs(expected).max())
            largest = max(largest, float(deviation.max()))
    measured(f"Savitzky-Golay filters of {n} values", 6 * n, largest, 1e-12, "")


def uncomfortable(motion: Motion, dt: float) -> bool:
    """The table of comfort in docs/reference/scoring.md with scipy."""
    n = len(motion.x)

    def filtered(values, window, derivative=0):
        return savgol_filter(values, min(window, n if n % 2 else n - 1), 2, deriv=derivative, delta=dt)

    heading = np.unwrap(motion.orientation)
    turning = np.where(np.isfinite(motion.yaw_rate), motion.yaw_rate, np.gradient(heading, dt))
    lateral = motion.velocity * turning
    along_road = filtered(motion.acceleration, 7)
    worst = [
        (along_road.max(), 2.40),
        (-along_road.min(), 4.05),
        (np.abs(filtered(lateral, 7)).max(), 4.89),
        (np.abs(filtered(heading, 15, 1)).max(), 0.95),
        (np.abs(filtered(heading, 15, 2)).max(), 1.93),
        (np.abs(filtered(motion.acceleration, 15, 1)).max(), 4.13),
        (np.abs(filtered(np.hypot(motion.acceleration, lateral), 15, 1)).max(), 8.37),
    ]
    return any(value > bound for value, bound in worst)


def test_comfort_is_that_of_the_table_with_filters_of_scipy(recorded, measured):
    wrong, verdicts = [], []
    for scenario in recorded:
        for row, motion in drives(scenario, 40, 1):
            expected = uncomfortable(motion, scenario.dt)
            verdicts.append(expected)
            if comfort_term(motion, scenario.dt, ComfortBounds()).value != float(not expected):
                wrong.append((scenario.name, int(scenario.obstacles.ids[row])))
    assert 0.1 < np.mean(verdicts) < 0.9, "both verdicts must be common"
    measured("comfort of recorded drives", len(verdicts), len(wrong), 0, "drives", cases=wrong)


def test_limits_and_directions_are_those_of_the_lanelets_below(recorded, measured):
    rng, n, wrong, n_close, n_limits, n_against = np.random.default_rng(2), 0, [], 0, 0, 0
    for scenario in recorded:
        road, lanes = core_road(scenario, RoadSettings()), Lanes(scenario)
        rows, columns = np.nonzero(scenario.obstacles.valid)
        picked = rng.choice(len(rows), min(4 * MOMENTS, len(rows)), replace=False)
        fields = scenario.obstacles.x, scenario.obstacles.y, scenario.obstacles.orientation
        x, y, orientation = (np.ascontiguousarray(field[rows[picked], columns[picked]]) for field in fields)
        # Every second one drives the other way round, so that there is oncoming traffic.
        orientation[::2] += math.pi
        limit, off = road.lane_rules(x, y, orientation)
        for k in range(len(picked)):
            place = float(x[k]), float(y[k]), float(orientation[k])
            angles = lanes.angles(*place)
            # Where a lane bends, its direction is a matter of a few degrees.
            if lanes.borders.distance(shapely.Point(x[k], y[k])) < BORDER or any(
                abs(a - math.pi / 2) < 0.2 for a in angles
            ):
                n_close += 1
                continue
            n, n_limits, is_against = n + 1, n_limits + math.isfinite(limit[k]), min(angles, default=0.0) > math.pi / 2
            n_against += is_against
            found = (
                math.isnan(off[k]),
                bool(off[k] > math.pi / 2),
                float(limit[k]) if math.isfinite(limit[k]) else math.nan,
            )
            expected = not angles, is_against, lanes.limit(*place)
            if not np.array_equal(found, expected, equal_nan=True):
                wrong.append((scenario.name, *place, expected, found))
    assert min(n_limits, n_against) > 100
    remark = f"{n_limits} with a limit, {n_against} against all lanes; {n_close} beside a border or across left out"
    measured("lanelets below, their directions and limits", n, len(wrong), 0, "states", remark, wrong)


def test_speed_and_direction_terms_are_sums_over_the_states(recorded, measured):
    n, largest = 0, 0.0
    for scenario in recorded:
        road = core_road(scenario, RoadSettings())
        for _, motion in drives(scenario, DRIVES, 3):
            limit, off = road.lane_rules(motion.x, motion.y, motion.orientation)
            # Half the limit, so that there is speeding; the other way round, so that there is oncoming traffic.
            slow, wrong_way = 0.5 * limit, math.pi - off
            known = np.isfinite(slow)
            if known.any():
                seconds = known.sum() * scenario.dt
                total = sum(
                    max(v - v_max, 0.0) * scenario.dt
                    for v, v_max in zip(motion.velocity[known], slow[known], strict=True)
                )
                expected = max(0.0, 1.0 - total / (2.23 * seconds))
                found = speed_term(motion.velocity, slow, scenario.dt, 2.23).value
                largest, n = max(largest, abs(found - expected)), n + 1
            window = max(1, round(1.0 / scenario.dt))
            against = [
                abs(v) * scenario.dt * (a > math.pi / 2) for v, a in zip(motion.velocity, wrong_way, strict=True)
            ]
            most = max(sum(against[max(0, k + 1 - window) : k + 1]) for k in range(len(against)))
            expected = 1.0 if most < 2.0 else 0.5 if most < 6.0 else 0.0
            if min(abs(most - 2.0), abs(most - 6.0)) > 1e-9:
                found = direction_term(motion, wrong_way, scenario.dt).value
                largest, n = max(largest, abs(found - expected)), n + 1
    measured("terms of speed and direction", n, largest, 1e-12, "")


def time_to_contact(own, own_velocity, other, other_velocity):
    """Exact: when the difference of both positions enters the sum of one body and the other one's reflection."""
    corners = [np.array(body.exterior.coords)[:4] for body in (own, other)]
    differences = (corners[0][:, None, :] - corners[1][None, :, :]).reshape(-1, 2)
    meeting = shapely.MultiPoint(differences).convex_hull
    path = shapely.LineString([(0.0, 0.0), tuple((np.array(other_velocity) - np.array(own_velocity)) * HORIZON)])
    if meeting.intersects(shapely.Point(0.0, 0.0)):
        return 0.0
    if path.length == 0.0 or not path.intersects(meeting):
        return math.inf
    return HORIZON * shapely.Point(0.0, 0.0).distance(path.intersection(meeting)) / path.length


def test_times_to_contact_are_those_of_bodies_that_go_straight_on(recorded, measured):
    rng, n, n_finite, n_close, largest, wrong = np.random.default_rng(4), 0, 0, 0, 0.0, []
    for scenario in recorded:
        obstacles, lanes, site = scenario.obstacles, Lanes(scenario), site_of(scenario)
        given = traffic(site, scenario)
        crossing = {lanes.index[number] for number in site.crossing}
        rows, columns = np.nonzero(obstacles.valid)
        is_usable = len(rectangles(scenario)) == len(obstacles.ids) - int(obstacles.is_static.sum())
        if not is_usable or obstacles.is_static.any():
            continue
        picked = rng.choice(len(rows), min(3 * MOMENTS, len(rows)), replace=False)
        for row, k in zip(rows[picked].tolist(), columns[picked].tolist(), strict=True):
            shape, number = obstacles.shapes[row], int(obstacles.ids[row])
            axle = rear_axle_to_center(shape.length)
            times, _ = given.straight_times([number], [axle], HORIZON, 1)
            place = tuple(float(field[row, k]) for field in (obstacles.x, obstacles.y, obstacles.orientation))
            own = rectangle(shape.length, shape.width, *place)
            near = [shapely.Point(*corner) for corner in [*own.exterior.coords, place[:2]]]
            if min(lanes.borders.distance(point) for point in near) < BORDER:
                n_close += 1
                continue
            is_open = not lanes.is_within_one(own, *place[:2]) or bool(crossing & set(lanes.below(*place[:2])))
            expected = brute_force(obstacles, row, k, axle, 150.0 if is_open else 30.0)
            found = float(times[0, k])
            n, n_finite = n + 1, n_finite + math.isfinite(expected)
            if math.isinf(found) and math.isinf(expected):
                continue
            deviation = abs(found - expected)
            largest = max(largest, deviation if math.isfinite(deviation) else 0.0)
            if not deviation < 2e-3:
                wrong.append((scenario.name, number, k, expected, found))
    assert n_finite > 0
    remark = f"{n_finite} within the horizon; {n_close} on a border left out"
    measured("time to contact", n, len(wrong), 0, "moments", remark, wrong)
    measured("time to contact", n_finite, largest, 2e-3, "s")


def brute_force(obstacles, row, k, axle, degrees):
    x, y, heading, speed = (
        float(field[row, k]) for field in (obstacles.x, obstacles.y, obstacles.orientation, obstacles.velocity)
    )
    if abs(speed) <= 0.005:
        return math.inf
    shape = obstacles.shapes[row]
    own = rectangle(shape.length, shape.width, x, y, heading)
    rear = x - axle * math.cos(heading), y - axle * math.sin(heading)
    least = math.inf
    for other in np.flatnonzero(obstacles.valid[:, k]).tolist():
        if other == row:
            continue
        place = tuple(float(field[other, k]) for field in (obstacles.x, obstacles.y, obstacles.orientation))
        bearing = math.atan2(place[1] - rear[1], place[0] - rear[0])
        if abs(turned(bearing - heading)) > math.radians(degrees):
            continue
        velocity = float(obstacles.velocity[other, k])
        body = rectangle(obstacles.shapes[other].length, obstacles.shapes[other].width, *place)
        steps = [(v * math.cos(a), v * math.sin(a)) for v, a in ((speed, heading), (velocity, place[2]))]
        least = min(least, time_to_contact(own, steps[0], body, steps[1]))
    return least


def test_arc_lengths_along_a_path_are_those_of_shapely(recorded, measured):
    n, largest, wrong = 0, 0.0, []
    for scenario in recorded:
        for row, motion in drives(scenario, DRIVES, 5):
            # A recorded drive, smoothed to metres, is a path that its neighbours drive along, too.
            places = np.column_stack([motion.x, motion.y])
            way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(places, axis=0).T))])
            path = places[np.flatnonzero(np.diff(np.floor(way / 2.0), prepend=-1.0) > 0)]
            if len(path) < 3 or not shapely.LineString(path).is_simple:
                continue
            for _, other in drives(scenario, 3, row):
                s, d = along(path, other)
                points = shapely.points(other.x, other.y)
                apart = shapely.distance(shapely.LineString(path), points)
                expected = shapely.line_locate_point(shapely.LineString(path), points)
                inside = (expected > 0.0) & (expected < shapely.LineString(path).length) & (apart < 2.0)
                if not inside.all():
                    continue
                n += len(points)
                deviation = np.maximum(np.abs(s - expected), np.abs(np.abs(d) - apart))
                largest = max(largest, float(deviation.max()))
                if deviation.max() > 1e-6:
                    wrong.append((scenario.name, row, float(deviation.max())))
    measured("arc length and distance along a path", n, largest, 1e-6, "m", cases=wrong)


def moved(scenario, row, shift):
    """The recordings with one vehicle so many steps later."""
    obstacles = scenario.obstacles
    tables = {}
    for name in ("x", "y", "orientation", "velocity", "acceleration", "yaw_rate", "valid"):
        table = getattr(obstacles, name).copy()
        line = np.full(table.shape[1], False if name == "valid" else np.nan, dtype=table.dtype)
        kept = slice(max(0, shift), table.shape[1] + min(0, shift))
        line[kept] = table[row, max(0, -shift) : table.shape[1] - max(0, shift)]
        table[row] = line
        tables[name] = table
    return dataclasses.replace(scenario, obstacles=dataclasses.replace(obstacles, **tables))


def first_touch(scenario, row, rows):
    """The other one that a vehicle touches first, and the step at which it does; None if it was never apart."""
    obstacles = scenario.obstacles

    def bodies(one, columns):
        shape = obstacles.shapes[one]
        fields = obstacles.x, obstacles.y, obstacles.orientation
        return [rectangle(shape.length, shape.width, *(float(f[one, k]) for f in fields)) for k in columns]

    best = None
    for other in rows:
        common = np.flatnonzero(obstacles.valid[row] & obstacles.valid[other]) if other != row else np.empty(0, int)
        near = [
            k
            for k in common.tolist()
            if np.hypot(obstacles.x[row, k] - obstacles.x[other, k], obstacles.y[row, k] - obstacles.y[other, k]) < 15.0
        ]
        touching = shapely.intersects(bodies(row, near), bodies(other, near)) if near else np.empty(0, bool)
        for k, touches in zip(near, np.atleast_1d(touching).tolist(), strict=True):
            if touches:
                if k - 1 in common and k - 1 in near and not touching[near.index(k - 1)] and (not best or k < best[1]):
                    best = other, k
                break
    return best


def body(scenario, row, columns):
    obstacles = scenario.obstacles
    fields = (getattr(obstacles, name)[row, columns] for name in ("x", "y", "orientation", "velocity"))
    return Body(obstacles.shapes[row].length, obstacles.shapes[row].width, *fields)


def test_blame_is_that_of_the_ways_and_rooms_written_out(recorded, measured):
    wrong, kinds, n_close, largest, rng = [], [], 0, 0.0, np.random.default_rng(6)
    for scenario in recorded:
        rows = rectangles(scenario)
        site, lanes = site_of(scenario), Lanes(scenario)
        crossing = {lanes.index[number] for number in site.crossing}
        for row in rng.permutation(rows)[:MOVED].tolist():
            shift = int(rng.integers(5, 41) * rng.choice([-1, 1]))
            if abs(shift) >= scenario.obstacles.n_steps - 2:
                continue
            other_world = moved(scenario, row, shift)
            touched = first_touch(other_world, row, rows)
            if touched is None:
                continue
            partner, k = touched
            valid = other_world.obstacles.valid
            common = valid[row] & valid[partner]
            first = k - int(np.flatnonzero(np.append(~common[:k][::-1], True))[0])
            columns = np.arange(first, k + 1)
            agent, other = body(other_world, row, columns), body(other_world, partner, columns)
            contact = first_true(
                lambda at, a=agent, o=other: a.at(at).intersects(o.at(at)), k - 1.0 - first, float(k - first), 50
            )
            x, y, _, _ = agent.state(contact)
            expected = judgement(
                lanes,
                agent,
                other,
                contact,
                is_oncoming_traffic=True,
                is_crossing=bool(crossing & set(lanes.below(x, y))),
                dt=scenario.dt,
            )
            ids = (int(scenario.obstacles.ids[row]), int(scenario.obstacles.ids[partner]))
            found = traffic(site, other_world).blame([(*ids, k, True)], (0.25, 6.0), (0.75, 4.0))
            case = (scenario.name, *ids, shift, k, expected, {name: values[0] for name, values in found.items()})
            if expected.is_close:
                n_close += 1
                continue
            kinds.append(expected.kind)
            if found["kind"][0] != expected.kind:
                wrong.append(case)
                continue
            decided = {
                one.step + first: one for one in (expected.into_theirs, expected.into_ours) if one is not None
            }.get(int(found["decided_at"][0]))
            if decided is not None and expected.kind != "":
                largest = max(largest, abs(float(found["gap"][0]) - decided.gap))
    counts = ", ".join(f"{kinds.count(kind)} {kind or 'no fault'}" for kind in sorted(set(kinds)))
    remark = f"{counts}; {n_close} within 5 cm of the room left out"
    measured("verdicts of blame", len(kinds), len(wrong), 0, "contacts", remark, wrong)
    measured("gap of the verdict", sum(map(bool, kinds)), largest, 0.02, "m")
