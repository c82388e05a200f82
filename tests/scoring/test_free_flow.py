"""Free flow: golden times, computed by another program from the definition, and properties."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np
import pytest

from interdrive.scoring.free_flow import SPACING, Stop, free_flow_times, speed_caps, stated_limits, time_at

GOLDEN = Path(__file__).parent / "golden" / "free_flow.csv"
PLACES = np.arange(401) * SPACING
STRAIGHT = np.zeros(401)
BEND = np.where((PLACES >= 40.0) & (PLACES <= 60.0), 1.0 / 16.0, 0.0)
TOWN = 50.0 / 3.6


def limits(first, *later):
    found = np.full(len(PLACES), first)
    for way, speed in later:
        found[way - 1e-9 <= PLACES] = speed
    return found


def caps(limit, curvature=STRAIGHT, across=4.0, most=math.inf):
    return speed_caps(curvature, limit, across, most)


CASES = {
    "constant": (caps(limits(10.0)), 10.0, ()),
    "from standing, 50 km/h": (caps(limits(TOWN)), 0.0, ()),
    "starts too fast": (caps(limits(10.0)), 20.0, ()),
    "limit 20 then 10 from 60 m on": (caps(limits(20.0, (60.0, 10.0))), 20.0, ()),
    "limit 10 then 20 from 60 m on": (caps(limits(10.0, (60.0, 20.0))), 10.0, ()),
    "bend of 16 m from 40 to 60 m, car": (caps(limits(TOWN), BEND), TOWN, ()),
    "the same, truck (3 m/s2 across)": (caps(limits(TOWN), BEND, 3.0), TOWN, ()),
    "no bound but the vehicle's 30 m/s": (caps(limits(math.inf), most=30.0), 25.0, ()),
    "red at 50 m until 12 s": (caps(limits(10.0)), 10.0, (Stop(50.0, ((0.0, 12.0),)),)),
    "red at 50 m, green again before arrival": (caps(limits(10.0)), 10.0, (Stop(50.0, ((0.0, 4.0),)),)),
    "two lights": (caps(limits(10.0)), 10.0, (Stop(50.0, ((0.0, 12.0),)), Stop(120.0, ((20.0, 30.0),)))),
    "standing start, red at 20 m until 3 s": (caps(limits(10.0)), 0.0, (Stop(20.0, ((0.0, 3.0),)),)),
}


def golden():
    with GOLDEN.open(newline="") as file:
        return [(row["case"], float(row["metres"]), float(row["seconds"])) for row in csv.DictReader(file)]


@pytest.mark.parametrize(("case", "way", "seconds"), golden())
def test_times_are_those_of_the_definition(case, way, seconds):
    assert time_at(free_flow_times(*CASES[case]), way) == pytest.approx(seconds, abs=1e-9), "s"


def slow_but_plain(cap, velocity):
    """The definition, place by place."""
    back = cap.copy()
    for i in range(len(cap) - 2, -1, -1):
        back[i] = min(back[i], math.sqrt(back[i + 1] ** 2 + 3.0))
    speed, time = [velocity], [0.0]
    for i in range(1, len(cap)):
        faster, slower = math.sqrt(speed[-1] ** 2 + 2.0), math.sqrt(max(speed[-1] ** 2 - 3.0, 0.0))
        speed.append(max(min(back[i], faster), slower))
        time.append(time[-1] + 0.5 / max(0.5 * (speed[-1] + speed[-2]), 0.05))
    return np.array(time)


@pytest.mark.parametrize("seed", range(20))
def test_times_are_those_of_the_definition_on_random_ways(seed):
    random = np.random.default_rng(seed)
    cap = np.repeat(random.uniform(0.5, 30.0, 40), 10)
    velocity = random.uniform(0.0, 40.0)
    assert free_flow_times(cap, velocity) == pytest.approx(slow_but_plain(cap, velocity), abs=1e-9), "s"


def test_a_stop_sign_takes_a_stop_and_the_time_to_stand():
    free, stopping = (free_flow_times(caps(limits(10.0)), 10.0, stops) for stops in ((), (Stop(50.0, duration=1.0),)))
    # Braking from 10 m/s with 3 m/s² and accelerating with 2 m/s² again takes 10/3/2 + 10/2/2 s more.
    assert time_at(stopping, 150.0) - time_at(free, 150.0) == pytest.approx(1.0 + 10.0 / 6.0 + 2.5, abs=0.2), "s"


def test_where_no_limit_is_stated_the_nearest_one_within_50_m_counts():
    stated = np.full(401, np.nan)
    stated[100], stated[120] = 10.0, 20.0
    filled = stated_limits(stated, 7.0)
    assert filled[0] == 10.0, "at 0 m, 50 m before it"
    assert filled[109] == 10.0
    assert filled[112] == 20.0
    assert filled[221] == 7.0, "50.5 m behind it"
    assert stated_limits(np.full(3, np.inf), 7.0).tolist() == [7.0] * 3
