"""Criticality against CommonRoad-CriMe 0.4.5 where agreement is expected; docs/reference/criticality.md has the rest.

Following: a straight road along +x (turned by 1e-4 rad), constant accelerations, the vehicle ahead not braking,
relative acceleration 0 or above 0.1 m/s². CriMe rounds: most measures to 2 digits; those derived from them follow.
"""

from __future__ import annotations

import itertools
from collections import defaultdict

import numpy as np
import pytest
from crime import DT, HEADING, LENGTH, WIDTH, CriMe, Way, crossing, straight

from interdrive.criticality import CriticalitySettings, evaluate
from interdrive.files import scenario_from_commonroad

SETTINGS = CriticalitySettings(oncoming_filter=False)
#: Rounding of a headway to centimetres, and half a length at the road's angle.
HEADWAY = 0.006
#: (speeds of both, accelerations of both).
MOTIONS = [
    ((20.0, 10.0), (0.0, 0.0)),
    ((20.0, 12.0), (-1.0, 0.0)),
    ((18.0, 10.0), (1.0, 0.0)),
    ((20.0, 10.0), (0.0, 0.5)),
    ((15.0, 0.0), (0.0, 0.0)),
    ((15.0, 5.0), (-2.0, 0.0)),
]
GAPS = (12.0, 22.3, 30.05, 40.0)
N, STEPS = 22, range(0, 20, 5)


def following(gap, motion):
    """A scenario of two cars, one behind the other, and the same for us."""
    (own, other), (own_acceleration, other_acceleration) = motion

    def on_road(s, velocity, acceleration):
        return Way(s * np.cos(HEADING), s * np.sin(HEADING), HEADING, velocity, acceleration)

    return straight(on_road(50.0, own, own_acceleration), on_road(50.0 + LENGTH + gap, other, other_acceleration), N)


class Worst:
    """Largest deviation and the largest share of what is allowed, per measure."""

    def __init__(self):
        self.found = defaultdict(lambda: [0, 0.0, 0.0, []])

    def add(self, name, ours, theirs, allowed, case):
        ours, theirs, allowed = np.broadcast_arrays(*map(np.atleast_1d, (ours, theirs, allowed)))
        both = np.isfinite(ours) & np.isfinite(theirs)
        entry = self.found[name]
        entry[0] += int(both.sum())
        disagree = np.isfinite(ours) != np.isfinite(theirs)
        if disagree.any():
            entry[2] = np.inf
            entry[3].append((case, ours[disagree][:3], theirs[disagree][:3]))
        if both.any():
            deviation = np.abs(ours - theirs)[both]
            entry[1] = max(entry[1], float(deviation.max()))
            share = deviation / allowed[both]
            entry[2] = max(entry[2], float(share.max()))
            if share.max() > 1.0:
                at = int(share.argmax())
                entry[3].append((case, float(ours[both][at]), float(theirs[both][at])))

    def enter(self, measured, where, units):
        for name, (count, largest, share, cases) in self.found.items():
            remark = f"largest deviation {largest:.2g} {units.get(name, '')}".rstrip()
            measured(f"CriMe, {where}: {name}, share of what is allowed", count, share, 1.0, "", remark, cases)


UNITS = {"hw": "m", "thw": "s", "ttc": "s", "dce": "m", "ttce": "s", "a_long_req": "m/s²", "a_lat_req": "m/s²"}
UNITS |= {"msd": "m", "tet": "s", "tit": "s²", "et": "s", "pet": "s"}


def test_following_on_a_straight_road(measured):
    worst = Worst()
    for gap, motion in itertools.product(GAPS, MOTIONS):
        scenario = following(gap, motion)
        ours, crime = evaluate(scenario_from_commonroad(scenario), settings=SETTINGS), CriMe(scenario, 1)
        case = (gap, motion)
        values = {
            name: ours[name][0, list(STEPS)] for name in ("hw", "ttc", "a_long_req", "btn", "a_lat_req", "stn", "msd")
        }
        theirs = {name: crime.compute(name, 2, STEPS) for name in values}
        # Contact, or one having gone through the other, ends the comparison: CriMe has no value for it. Just before,
        # a centimetre of its rounding is worth several m/s².
        apart = np.isfinite(values["hw"]) & (values["hw"] > 4.0)
        (own, other), (own_acceleration, other_acceleration) = motion
        time = np.array(STEPS) * DT
        own_speed = own + own_acceleration * time
        closing = other - own + (other_acceleration - own_acceleration) * time
        headway = np.where(apart, values["hw"], 1.0)
        root = np.sqrt(np.maximum(closing**2 - 2 * headway * (other_acceleration - own_acceleration), 1e-6))
        ttc = 0.005 + HEADWAY / root
        braking = 0.005 + closing**2 / (2 * headway**2) * HEADWAY
        t = np.where(values["ttc"] > 0.0, values["ttc"], np.inf)
        steering = 0.005 + 4 * WIDTH / t**3 * ttc + 2 * np.abs(own_speed * np.sin(HEADING)) / t
        allowed = {
            "hw": np.full(len(STEPS), HEADWAY),
            "ttc": ttc,
            "a_long_req": braking,
            "btn": braking / 11.5 + 5e-5,
            "a_lat_req": steering,
            "stn": steering / 8.0 + 5e-5,
            "msd": np.full(len(STEPS), 0.0051),
        }
        for name, value in values.items():
            # Where the gap opens CriMe brakes all the same.
            kept = apart & (closing < 0.0) if name in ("a_long_req", "btn") else apart
            worst.add(name, value[kept], theirs[name][kept], allowed[name][kept], case)
    worst.enter(measured, "following", UNITS)


def test_exposure_on_a_straight_road(measured):
    """Without the last sample, which CriMe leaves out; the last state is an extra one for that."""
    worst = Worst()
    for gap, motion in itertools.product(GAPS[::2], MOTIONS):
        scenario = following(gap, motion)
        ours, crime = evaluate(scenario_from_commonroad(scenario), settings=SETTINGS), CriMe(scenario, 1)
        ttc = ours["ttc"][0, :-1]
        if (ours["hw"][0] < 0.5).any() or (np.abs(ttc - 2.0) < 0.011).any():
            continue
        exposed = ttc <= 2.0
        n = int(exposed.sum())
        worst.add("tet", DT * n, crime.compute("tet", 2, [0]), 1e-9, (gap, motion))
        allowed = max(n, 1) * DT * (0.005 + HEADWAY / 0.5) + 5e-5
        worst.add("tit", DT * (2.0 - ttc[exposed]).sum(), crime.compute("tit", 2, [0]), allowed, (gap, motion))
    worst.enter(measured, "following", UNITS)


def test_time_headway_at_constant_speed(measured):
    """CriMe waits for the recording: between ours and one time step more."""
    worst = Worst()
    for gap, speed in itertools.product((8.03, 12.37, 17.71), (10.0, 15.0, 20.0)):
        scenario = straight(Way(50.0, 0.005, HEADING, speed), Way(55.0 + gap, 0.0055, HEADING, speed), 25)
        ours = evaluate(scenario_from_commonroad(scenario), settings=SETTINGS)["thw"][0, 0]
        theirs = CriMe(scenario, 1).compute("thw", 2, [0])[0]
        worst.add("thw", ours + 0.5 * DT, theirs, 0.5 * DT + 1e-3, (gap, speed))
    worst.enter(measured, "following", UNITS)


#: (start of the first car along x, its speed, start of the second along y, its speed).
CROSSINGS = [
    (-34.55, 10.0, -64.55, 10.0),
    (-40.3, 12.0, -55.7, 8.0),
    (-30.2, 8.0, -70.4, 12.0),
    (-45.1, 15.0, -80.9, 15.0),
    (-36.6, 9.0, -52.2, 6.0),
]


def test_crossing_at_right_angles(measured):
    worst = Worst()
    for case in CROSSINGS:
        x, own_speed, y, other_speed = case
        scenario = crossing(Way(x, 0.0, 0.0, own_speed), Way(0.0, y, 0.5 * np.pi, other_speed), 120)
        ours, crime = evaluate(scenario_from_commonroad(scenario), settings=SETTINGS), CriMe(scenario, 1)
        steps = range(0, 20, 5)
        for name, allowed in (("dce", 0.0051), ("ttce", 1e-3)):
            worst.add(name, ours[name][0, list(steps)], crime.compute(name, 2, steps), allowed, case)
        # CriMe enters an area one step early.
        worst.add("et", ours["et"][0, 0] + DT, crime.compute("et", 2, [0]), 1e-4, case)
        worst.add("pet", ours["pet"][0, 0] - DT, crime.compute("pet", 2, [0]), 1e-4, case)
        psd = ours["psd"][0, list(steps)]
        allowed = 0.005 + psd * 0.005 / ours["msd"][0, list(steps)]
        worst.add("psd", psd, crime.compute("psd", 2, steps), allowed, case)
    worst.enter(measured, "crossing", UNITS)


@pytest.mark.parametrize(
    ("own", "other", "name", "ours", "theirs"),
    [
        ((0.7, 10.0, 0.0), 0.0, "hw", 30.0, None),
        ((HEADING, 20.0, 0.0), -2.0, "ttc", 2.416198, np.inf),
        ((HEADING, 20.0, 0.0), -2.0, "a_long_req", -3.666667, 0.0),
    ],
)
def test_where_crime_is_known_to_differ_it_still_does(own, other, name, ours, theirs):
    """The differences that the manual states: headings other than +x, vehicles ahead that brake."""
    heading, speed, acceleration = own
    way = np.array([np.cos(heading), np.sin(heading)])
    from crime import _scenario, car, lanelet

    start, ahead = 50.0 * way, 85.0 * way
    cars = [
        car(1, Way(*start, heading, speed, acceleration), 15),
        car(2, Way(*ahead, heading, 10.0, other), 15),
    ]
    scenario = _scenario([lanelet(100, (0.0, 0.0), heading, 500.0, 4.0)], cars)
    assert evaluate(scenario_from_commonroad(scenario), settings=SETTINGS)[name][0, 0] == pytest.approx(ours, abs=1e-4)
    found = CriMe(scenario, 1).compute(name, 2, [0])[0]
    assert abs(found - ours) > 1.0 if theirs is None else found == pytest.approx(theirs)
