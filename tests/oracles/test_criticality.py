"""Criticality of real recordings against shapely, and distances along paths against commonroad-clcs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely
from bodies import EXACT, EXACT_FAR_AWAY, body_of, distances, poses_of
from commonroad_curves import curvilinear

from interdrive import _core
from interdrive.criticality import CriticalitySettings, evaluate
from interdrive.native_settings import RoadSettings
from interdrive.scenario import Shape
from interdrive.scenario.native import core_road
from interdrive.testing import Car, straight_road, world

UNFILTERED = CriticalitySettings(oncoming_filter=False)
CROSSING = CriticalitySettings(oncoming_filter=False, conflict_areas="crossing")
#: Of each scenario so many vehicles and pairs are compared.
VEHICLES_MAX, PAIRS_MAX = 12, 600


def far_away(scenario):
    return np.nanmax(np.abs(np.concatenate([bound.ravel() for bound in scenario.lanelets.left]))) > 1e5


def closest(scenario, row, bodies):
    """Smallest footprint distance within the radius at every step, inf without participants, by shapely."""
    obstacles = scenario.obstacles
    own = poses_of(obstacles, row)
    apart = np.hypot(obstacles.x - own[:, 0], obstacles.y - own[:, 1])
    apart = np.where(obstacles.valid & obstacles.valid[row], apart, np.inf)
    apart[row] = np.inf
    apart[apart >= UNFILTERED.radius] = np.inf
    reach = np.array([body.reach for body in bodies])
    # A participant whose circle is farther away than another one's centre cannot be the nearest.
    worth = apart - reach[:, None] - reach[row] <= apart.min(axis=0)
    worth &= np.isfinite(apart)
    nearest = np.full(obstacles.n_steps, np.inf)
    for other in np.flatnonzero(worth.any(axis=1)).tolist():
        steps = np.flatnonzero(worth[other])
        found = distances(bodies[row], own[steps], bodies[other], poses_of(obstacles, other)[steps])
        nearest[steps] = np.minimum(nearest[steps], found)
    return nearest


def test_distances_of_closest_encounters_are_those_of_shapely(recorded, measured):
    worst, worst_far, n, n_scenarios, wrong = 0.0, 0.0, 0, 0, []
    for scenario in recorded:
        found = evaluate(scenario, settings=UNFILTERED)
        if not len(found.participant_id):
            continue
        n_scenarios += 1
        bodies = [body_of(shape) for shape in scenario.obstacles.shapes]
        for place, number in enumerate(found.participant_id[:VEHICLES_MAX].tolist()):
            row = int(np.searchsorted(scenario.obstacles.ids, number))
            nearest = closest(scenario, row, bodies)
            steps = np.flatnonzero(found.present[place])
            for k in steps[:: max(1, len(steps) // 12)].tolist():
                ahead = nearest[k:]
                dce, ttce = found["dce"][place, k], found["ttce"][place, k]
                if not np.isfinite(ahead).any():
                    assert np.isinf(dce)
                    assert np.isinf(ttce)
                    continue
                n += 1
                deviation = abs(ahead.min() - dce)
                if far_away(scenario):
                    worst_far = max(worst_far, deviation)
                else:
                    worst = max(worst, deviation)
                at = round(ttce / scenario.dt)
                # The earliest one; where two steps differ by rounding, either.
                first = int(np.argmax(ahead <= ahead.min() + (EXACT_FAR_AWAY if far_away(scenario) else EXACT)))
                if at != first and abs(ahead[at] - ahead[first]) > EXACT_FAR_AWAY:
                    wrong.append((scenario.name, number, k, at, first))
    assert n_scenarios >= 0.3 * len(recorded)
    remark = f"{n_scenarios} scenarios"
    measured("dce: shapely", n, worst, EXACT, "m", remark)
    measured("dce: shapely, coordinates in the millions", n, worst_far, EXACT_FAR_AWAY, "m")
    measured("ttce: shapely, different steps", n, len(wrong), 0, "", remark, wrong)


def outline(scenario, number):
    row = int(np.searchsorted(scenario.lanelets.ids, number))
    return shapely.Polygon(np.concatenate([scenario.lanelets.left[row], scenario.lanelets.right[row][::-1]]))


def stay(scenario, row, area, body):
    """First step in the area, and first later one out of it (None: never), by shapely."""
    obstacles = scenario.obstacles
    steps = np.flatnonzero(obstacles.valid[row])
    shapes = body.at(poses_of(obstacles, row)[steps])
    inside = shapely.distance(shapes, area) <= body.radius
    if not inside.any():
        return None
    enter = int(inside.argmax())
    later = np.flatnonzero(~inside[enter:])
    return int(steps[enter]), (int(steps[enter + later[0]]) if len(later) else None)


def test_encroachment_times_are_those_of_shapely(recorded, measured):
    """Pair by pair: times in the conflict area that a value names, worked out from the lanelets' outlines."""
    n_et, n_pet, n_scenarios, wrong, n_nan = 0, 0, 0, [], 0
    for scenario in recorded:
        all_vehicles = evaluate(scenario, settings=CROSSING)
        obstacles = scenario.obstacles
        bodies = [body_of(shape) for shape in obstacles.shapes]
        encroaching = all_vehicles.participant_id[all_vehicles.extremes["et"].path >= 0].tolist()
        pairs = [(a, b) for a in encroaching for b in all_vehicles.participant_id.tolist() if a != b][:PAIRS_MAX]
        n_before = n_et
        for a, b in pairs:
            found = evaluate(scenario, [a], other_ids=[b], settings=CROSSING, threads=1)
            row, other = (int(np.searchsorted(obstacles.ids, number)) for number in (a, b))
            for name in ("et", "pet"):
                extreme = found.extremes[name]
                if extreme.path[0] < 0:
                    continue
                lanelets = [outline(scenario, int(part)) for part in found.paths[extreme.path[0]].split(" x ")]
                if not all(lanelet.is_valid for lanelet in lanelets):
                    continue
                area = lanelets[0].intersection(lanelets[1])
                own = stay(scenario, row, area, bodies[row])
                if name == "et":
                    expected = np.nan if own[1] is None else (own[1] - own[0]) * scenario.dt
                    n_et, n_nan = n_et + 1, n_nan + int(own[1] is None)
                else:
                    expected = post_encroachment(scenario, own, row, stay(scenario, other, area, bodies[other]), other)
                    n_pet += 1
                if not np.isclose(extreme.value[0], expected, rtol=0.0, atol=1e-9, equal_nan=True):
                    wrong.append((scenario.name, a, b, name, float(extreme.value[0]), float(expected)))
        n_scenarios += n_et > n_before
    remark = f"{n_scenarios} scenarios, {n_nan} enter and never leave"
    measured("et: shapely, different values", n_et, sum(one[3] == "et" for one in wrong), 0, "", remark, wrong)
    measured("pet: shapely, different values", n_pet, sum(one[3] == "pet" for one in wrong), 0, "", remark, wrong)
    assert n_scenarios >= 0.2 * len(recorded), f"{n_scenarios} scenarios have encroachment"


def post_encroachment(scenario, own, row, others, other):
    obstacles = scenario.obstacles
    (first, first_row), (second, _) = sorted([(own, row), (others, other)], key=lambda item: (item[0][0], item[1]))
    last = int(np.flatnonzero(obstacles.valid[first_row])[-1])
    out = first[1] if first[1] is not None else last + 1 if last + 1 < obstacles.n_steps else None
    return 0.0 if out is None or second[0] < out else (second[0] - out) * scenario.dt


def test_lanelets_whose_ways_meet_are_those_of_shapely(recorded, measured):
    """Outlines eroded by shapely with mitred corners."""
    n, overlaps, wrong = 0, 0, []
    erosion, least = 0.3, 0.1
    for scenario in recorded:
        road = core_road(scenario, RoadSettings(open_end_length=0.0))
        ours = set(_core.overlapping_lanelets(road, erosion, least))
        ids = scenario.lanelets.ids.tolist()
        outlines = {number: outline(scenario, number) for number in ids}
        eroded = {number: shape.buffer(-erosion, join_style="mitre") for number, shape in outlines.items()}
        usable = [number for number in ids if outlines[number].is_valid]
        tree = shapely.STRtree([outlines[number] for number in usable])
        near = tree.query([outlines[number] for number in usable], predicate="intersects").T.tolist()
        for a, b in ((usable[i], usable[j]) for i, j in near if i < j):
            shared = eroded[a].intersection(eroded[b]).area
            n, overlaps = n + 1, overlaps + ((a, b) in ours)
            if ((a, b) in ours) != (shared > least):
                wrong.append((scenario.name, a, b, shared))
        apart = [(a, b) for a, b in ours if {a, b} <= set(usable) and not outlines[a].intersects(outlines[b])]
        wrong += [(scenario.name, a, b, 0.0) for a, b in apart]
    remark = f"{overlaps} do"
    measured("lanelets that overlap once eroded: shapely, different verdicts", n, len(wrong), 0, "", remark, wrong)


#: Distances along a path: on roads that bend no more than this [1/m], this near to their middle [m].
CURVATURE_MAX, OFFSET_MAX = 1.0 / 50.0, 2.0


@pytest.mark.parametrize("radius", [50.0, 80.0, 200.0])
def test_headways_on_arcs_are_those_of_curvilinear_coordinates_and_of_the_arc(radius, measured):
    """A standing car and one that is 5 to 80 m of arc ahead, both as far to the side; made small."""
    size, s = 0.01, np.linspace(5.0, 80.0, 61)
    angle = np.arange(-12.0, 95.0) / radius
    worst, worst_arc, n = 0.0, 0.0, 0
    for d in (-2.0, 0.0, 2.0):

        def at(angle, offset):
            return np.stack([(radius - offset) * np.sin(angle), radius - (radius - offset) * np.cos(angle)], axis=-1)

        scenario = world(straight_road(100.0), cars=[Car(1, 5.0), Car(2, 50.0)], steps=len(s) - 1)
        roads = replace(scenario.lanelets, left=(at(angle, 2.5),), right=(at(angle, -2.5),))
        angles = np.stack([np.zeros_like(s), s / radius])
        points = at(angles, d)
        obstacles = replace(
            scenario.obstacles,
            shapes=(Shape("circle", radius=size),) * 2,
            x=points[..., 0],
            y=points[..., 1],
            orientation=angles,
        )
        ours = evaluate(replace(scenario, lanelets=roads, obstacles=obstacles), [1], settings=UNFILTERED)["hw"][0]
        path = center_line(replace(scenario, lanelets=roads), [1])
        behind, ahead = (curvilinear(path, one) for one in points)
        theirs = ahead[:, 0] - behind[:, 0]
        kept = np.isfinite(ours) & np.isfinite(theirs)
        worst = max(worst, float(np.abs(ours + 2 * size - theirs)[kept].max()))
        worst_arc = max(worst_arc, float(np.abs(ours + 2 * size - s)[kept].max()))
        n += int(kept.sum())
    measured(
        f"hw: commonroad-clcs, arc of {radius:.0f} m", n, worst, 0.06, "m", f"{worst_arc:.2g} m from the arc's length"
    )


def test_headways_are_distances_in_curvilinear_coordinates(recorded, measured):
    """Vehicles made small, so that a headway is the distance of the centres along the path."""
    size = 0.01
    worst, n, n_scenarios, cases, all_worst = 0.0, 0, 0, [], 0.0
    for scenario in recorded:
        obstacles = scenario.obstacles
        small = replace(obstacles, shapes=(Shape("circle", radius=size),) * len(obstacles.ids))
        found = evaluate(replace(scenario, obstacles=small), settings=UNFILTERED)
        n_before = n
        series = found.series["hw"]
        for way in np.unique(series.path[series.path >= 0])[:12].tolist():
            rows, columns = np.nonzero((series.path == way) & np.isfinite(series.value))
            keep = np.linspace(0, len(rows) - 1, min(25, len(rows))).astype(int)
            rows, columns = rows[keep], columns[keep]
            own = np.searchsorted(obstacles.ids, found.participant_id[rows])
            other = np.searchsorted(obstacles.ids, series.partner_id[rows, columns])
            path = center_line(scenario, [int(part) for part in found.paths[way].split(" > ")])
            points = [
                np.column_stack([obstacles.x[who, columns], obstacles.y[who, columns]]) - path[0]
                for who in (own, other)
            ]
            behind, ahead = (curvilinear(path - path[0], one) for one in points)
            bend = sharpest_bend(path, behind[:, 0], ahead[:, 0])
            near = (np.abs(behind[:, 1]) <= OFFSET_MAX) & (np.abs(ahead[:, 1]) <= OFFSET_MAX)
            # A single lanelet may be driven against its direction.
            along = np.abs(ahead[:, 0] - behind[:, 0])
            deviation = np.abs(along - 2 * size - series.value[rows, columns])
            known = np.isfinite(deviation)
            kept = known & near & (bend <= CURVATURE_MAX)
            if kept.any():
                n += int(kept.sum())
                at = int(np.where(kept, deviation, -1.0).argmax())
                worst = max(worst, float(deviation[at]))
                if deviation[at] > 0.06:
                    cases.append(
                        (
                            scenario.name,
                            found.paths[way],
                            int(found.participant_id[rows[at]]),
                            columns[at],
                            deviation[at],
                        )
                    )
            if known.any():
                all_worst = max(all_worst, float(deviation[known].max()))
        n_scenarios += n > n_before
    assert n_scenarios >= 0.3 * len(recorded)
    remark = f"{n_scenarios} scenarios; without conditions {all_worst:.2g} m"
    measured("hw: commonroad-clcs, bends above 50 m, at most 2 m aside", n, worst, 0.06, "m", remark, cases)


def center_line(scenario, lanelets):
    """The way of a path as a polyline, without its lead-in, with a metre of room at both ends."""
    rows = np.searchsorted(scenario.lanelets.ids, lanelets)
    parts = [0.5 * (scenario.lanelets.left[row] + scenario.lanelets.right[row]) for row in rows.tolist()]
    if len(parts) > 1 and np.hypot(*(parts[0][0] - parts[1][-1])) < np.hypot(*(parts[0][-1] - parts[1][0])):
        parts = [part[::-1] for part in parts]
    kept = list(parts[0][:2])
    for point in np.concatenate([parts[0][2:], *parts[1:]]):
        step = point - kept[-1]
        # Some lanelets start a little before the end of the one before.
        if np.hypot(*step) > 0.05 and (step @ (kept[-1] - kept[-2]) >= 0.0 or np.hypot(*step) > 3.0):
            kept.append(point)
    points = np.array(kept)

    def beyond(end, before):
        way = end - before
        return end + way * (10.0 / np.hypot(*way))

    return np.concatenate([[beyond(points[0], points[1])], points, [beyond(points[-1], points[-2])]])


def sharpest_bend(path, start, end):
    """Largest change of direction per metre around two arc lengths and between them, over 6 m, shape (pairs,)."""
    s = np.append(0.0, np.hypot(*np.diff(path, axis=0).T).cumsum())
    at = np.arange(0.0, s[-1], 1.0)
    fine = np.column_stack([np.interp(at, s, path[:, axis]) for axis in (0, 1)])
    way = np.unwrap(np.arctan2(*(fine[3:] - fine[:-3]).T[::-1]))
    bend = np.abs(way[3:] - way[:-3]) / 3.0
    found = np.zeros(len(start))
    for i, (a, b) in enumerate(zip(start, end, strict=True)):
        if np.isfinite(a + b):
            part = bend[max(0, int(min(a, b)) - 12) : int(max(a, b)) + 12]
            found[i] = part.max(initial=0.0)
    return found
