"""Reference drivers in one dimension.

`verdicts.csv` is a seeded sample that this code made once it agreed with all rows of `tests/oracles`; to write it anew,
call this file.
"""

import csv
from pathlib import Path

import numpy as np
import pytest

from interdrive import InputError
from interdrive.reference_drivers import DRIVERS, car_following, cut_in, cut_out, rss

SAMPLE = Path(__file__).with_name("verdicts.csv")


def verdicts() -> list[dict[str, str]]:
    draw = np.random.default_rng(157)
    rows = []
    for _ in range(60):
        velocity = round(draw.uniform(5.0, 36.0), 2)
        other, gap, sideways = velocity * draw.uniform(0.1, 0.95), draw.uniform(2.0, 60.0), draw.uniform(0.2, 1.8)
        case = {"velocity": velocity, "other_velocity": round(other, 2), "gap": round(gap, 1)}
        case["sideways"] = round(sideways, 2)
        rows.append(("cut_in", case, [cut_in(name, **case) for name in DRIVERS]))
    for _ in range(20):
        case = {"velocity": round(draw.uniform(5.0, 36.0), 2), "front_distance": round(draw.uniform(0.0, 60.0), 1)}
        case["sideways"] = round(draw.uniform(0.2, 2.9), 2)
        rows.append(("cut_out", case, [cut_out(name, **case) for name in DRIVERS if name != "r157"]))
    for _ in range(10):
        case = {"velocity": round(draw.uniform(5.0, 36.0), 2), "deceleration": round(draw.uniform(6.5, 9.8), 2)}
        rows.append(("car_following", case, [car_following(name, **case) for name in DRIVERS if name != "r157"]))
    return [
        {
            "case": kind,
            "numbers": " ".join(f"{name}={value:g}" for name, value in case.items()),
            "impact_speed": " ".join(f"{found.impact_speed[0]:.6f}" for found in endings),
        }
        for kind, case, endings in rows
    ]


def test_a_drawn_sample_ends_as_stored():
    with SAMPLE.open(newline="") as file:
        stored = list(csv.DictReader(file))
    assert len(stored) == 90
    assert verdicts() == stored


def test_a_careful_driver_avoids_a_far_cut_in_and_hits_a_near_one():
    found = cut_in("cc", velocity=30.0, other_velocity=15.0, gap=[20.0, 60.0], sideways=1.5)
    assert found.crash.tolist() == [True, False]
    assert found.impact_speed[0] > 10.0
    assert np.isnan(found.impact_speed[1])


def test_safe_distances_are_broadcast_and_never_negative():
    found = rss.same_direction([10.0, 20.0, 20.0], [10.0, 20.0, 60.0])
    # v r + 3 r²/2 + (v + 3 r)²/12 - u²/12 with r = 0.75
    assert found == pytest.approx([7.5 + 0.84375 + 12.25**2 / 12 - 100 / 12, 15.84375 + 22.25**2 / 12 - 400 / 12, 0.0])
    assert rss.lateral(0.0, 0.0, rss.INTEL) == pytest.approx([0.55])
    assert rss.opposite_direction(5.0, 5.0, rss.INTEL) == pytest.approx([34.572916666666664])


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (
            lambda: cut_in("cc", velocity=-1.0, other_velocity=1.0, gap=1.0, sideways=1.0),
            "a speed must not be negative",
        ),
        (
            lambda: cut_in("cc", velocity=10.0, other_velocity=1.0, gap=1.0, sideways=1e300),
            "the sideways speed must be at most 1000",
        ),
        (
            lambda: cut_out("cc", velocity=20.0, front_distance=np.inf, sideways=1.0),
            "the distance must be at most 1000",
        ),
        (
            lambda: cut_out("cc", velocity=20.0, front_distance=np.nan, sideways=1.0),
            "the distance must not be negative",
        ),
        (
            lambda: cut_in("me", velocity=1.0, other_velocity=1.0, gap=1.0, sideways=1.0),
            "there is no reference driver me",
        ),
        (lambda: cut_in("cc", velocity=[1, 2], other_velocity=[1, 2, 3], gap=1, sideways=1), "do not fit"),
        (lambda: cut_out("r157", velocity=1.0, front_distance=1.0, sideways=1.0), "r157 is defined for cut-ins"),
        (lambda: car_following("cc", velocity=[9.0, 9.0], deceleration=[1.0, 0.0]), "case 1: the deceleration must be"),
        (lambda: rss.same_direction(10.0, -1.0), "front: a speed must not be negative, is -1"),
        (lambda: rss.opposite_direction([5.0, np.nan], 1.0), "in_lane: a speed must be finite, is nan"),
        (lambda: rss.lateral(0.0, np.inf), "right: a speed must be finite, is inf"),
        (lambda: rss.same_direction([1.0, 2.0], [1.0, 2.0, 3.0]), "rear and front: no speeds that fit each other"),
        (lambda: rss.lateral("fast", 0.0), "left and right: no speeds that fit each other"),
        (lambda: rss.RssParameters(braking_min=0.0), "RssParameters: braking_min must be positive, is 0.0"),
        (lambda: rss.RssParameters(response=-0.1), "RssParameters: response must be not negative, is -0.1"),
        (lambda: rss.RssParameters(fluctuation="wide"), "RssParameters: fluctuation must be not negative, is 'wide'"),
    ],
)
def test_numbers_that_are_no_case_are_refused_in_one_line(call, words):
    with pytest.raises(InputError, match=words) as refused:
        call()
    assert "\n" not in str(refused.value)


if __name__ == "__main__":
    with SAMPLE.open("w", newline="") as file:
        writer = csv.DictWriter(file, ["case", "numbers", "impact_speed"], lineterminator="\n")
        writer.writeheader()
        writer.writerows(verdicts())
