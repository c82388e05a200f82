"""Verdicts on concrete cases: of reference drivers in one dimension, and of planners in worlds."""

from __future__ import annotations

import math
import multiprocessing
import os
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from interdrive.alks import worlds
from interdrive.alks.grids import MANOEUVRES, Grid
from interdrive.reference_drivers import DRIVERS, car_following, cut_in, cut_out
from interdrive.simulation import Simulation
from interdrive.storage import Column, arrow_table

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from interdrive.array_types import Bools, Floats
    from interdrive.reference_drivers import Endings
    from interdrive.storage import ArrowTable

#: Systems on motorways see farther than vehicles in towns [m].
SENSOR_RADIUS = 300.0
#: A case is over this long after the agent would have reached the other [s]; it takes 35 s at most.
_AFTERWARDS, _STEPS_MAX = 8.0, 350
#: Cases of a worker in one go.
_CHUNK = 32
#: What boundaries are of, ...
_ALONG = {"cut_in": "gap", "cut_out": "front_distance", "following": "deceleration"}
#: ... found to this [m, m/s²].
_ALONG_STEP = 0.1

#: Crash, impact speed [m/s], least time to collision [s], and whether it failed.
_Ending: TypeAlias = tuple[bool, float, float, bool]
#: Outcomes of agents that do not drive to the end; without a partner it is the edge of the road that is hit.
_FAILED = ("collision", "infeasible", "planner_error")

_ABSENT = "the manoeuvre has no such number"

#: Columns of alks.parquet.
ALKS_COLUMNS = (
    Column("manoeuvre", "label", "what happens", labels=tuple(MANOEUVRES)),
    Column("velocity", "number", "of the system at the start", "m/s"),
    Column("other_velocity", "number", "of the vehicle that cuts in", "m/s", null=_ABSENT),
    Column("gap", "number", "when it has its sideways speed", "m", null=_ABSENT),
    Column("front_distance", "number", "from the leader to what stands", "m", null=_ABSENT),
    Column("sideways", "number", "sideways speed of the other", "m/s", null=_ABSENT),
    Column("deceleration", "number", "of the leader", "m/s²", null=_ABSENT),
    Column("driver", "label", "reference driver or planner"),
    Column("crash", "truth", "it hits the other"),
    Column("failed", "truth", "its planner fails, or it leaves the road: no verdict on the crash"),
    Column(
        "impact_speed", "number", "difference of the speeds at the contact", "m/s", null="it does not hit the other"
    ),
    Column("ttc_min", "number", "least time to collision", "s", infinite=True),
    *(
        Column(
            f"preventable_{name}",
            "truth",
            f"`{name}` does not hit the other",
            null=f"`{name}` has no such manoeuvre, or begins it at another distance than the planner",
        )
        for name in DRIVERS
    ),
)


@dataclass(frozen=True)
class Verdicts:
    """How the cases of a grid end with one driver; arrays of shape (cases,).

    Attributes:
        grid: The cases.
        driver: Reference driver, or planner as it was named; `cc` as planner is `cc in worlds`.
        crash: Whether it hits the other.
        impact_speed: Difference of the speeds at the contact [m/s]; nan without one.
        ttc_min: Least time to collision [s]; inf without any.
        failed: Whether its planner fails or it leaves the road, so that to hit nothing says nothing.
        planner: The planner as it was named, and its predictor; both "" for a reference driver.
    """

    grid: Grid
    driver: str
    crash: Bools
    impact_speed: Floats
    ttc_min: Floats
    failed: Bools
    planner: str = ""
    predictor: str = ""


def has_driver(manoeuvre: str, driver: str) -> bool:
    """Whether a reference `driver` is defined for a `manoeuvre`."""
    return driver != "r157" or manoeuvre == "cut_in"


def is_comparable(found: Verdicts, driver: str) -> bool:
    """Whether a reference `driver` begins the cases where the driver that was `found` does.

    Planners begin cut-outs and followings at the distance that `cc` keeps; the others keep distances of their own.
    """
    return not found.planner or found.grid.manoeuvre == "cut_in" or driver == "cc"


def reference(grid: Grid, driver: str) -> Verdicts:
    """Verdicts of a reference driver in one dimension.

    Args:
        grid: The cases.
        driver: One of `interdrive.reference_drivers.DRIVERS`.

    Raises:
        InputError: The driver is not defined for the manoeuvre, or a case has a number that is none.
    """
    found = _law(grid.manoeuvre)(driver, **grid.cases)
    return Verdicts(grid, driver, found.crash, found.impact_speed, found.ttc_min, np.zeros(len(grid), dtype=np.bool_))


def driven(
    grid: Grid,
    planner: str,
    *,
    predictor: str = "neural",
    workers: int | None = None,
    on_cases: Callable[[int], None] | None = None,
) -> Verdicts:
    """Verdicts of a planner, which drives every case in a world.

    Args:
        grid: The cases.
        planner: The planner, as on the command line.
        predictor: Its predictor.
        workers: Processes; None: one per core. Results do not depend on it.
        on_cases: Called with the number of cases that are done.

    Raises:
        InputError: There is no such planner or predictor, or a case has a number that is none.
    """
    reference(grid, "cc")  # refuses such numbers
    one = partial(_drive, grid.manoeuvre, planner, predictor)
    rows = [grid.case(row) for row in range(len(grid))]
    chunks = [rows[start : start + _CHUNK] for start in range(0, len(rows), _CHUNK)]
    n_workers = workers or os.cpu_count() or 1
    endings: list[_Ending] = []

    def collect(found: Iterable[list[_Ending]]) -> None:
        for each in found:
            endings.extend(each)
            if on_cases is not None:
                on_cases(len(endings))

    if n_workers == 1 or len(chunks) < 2:
        collect(map(one, chunks))
    else:
        # Started afresh: threads of the core do not survive a fork.
        with ProcessPoolExecutor(n_workers, mp_context=multiprocessing.get_context("spawn")) as pool:
            collect(pool.map(one, chunks))
    table = np.array(endings, dtype=np.float64).reshape(-1, 4)
    name = f"{planner} in worlds" if planner in DRIVERS else planner
    crash, failed = table[:, 0] > 0.0, table[:, 3] > 0.0
    return Verdicts(grid, name, crash, table[:, 1].copy(), table[:, 2].copy(), failed, planner, predictor)


def table_of(found: Sequence[Verdicts]) -> ArrowTable:
    """The verdicts `found`, one row per case and driver, as an Arrow table with `ALKS_COLUMNS`."""
    columns: dict[str, list[object]] = {column.name: [] for column in ALKS_COLUMNS}
    for one in found:
        n = len(one.grid)
        columns["manoeuvre"] += [one.grid.manoeuvre] * n
        columns["driver"] += [one.driver] * n
        for name in ("velocity", "other_velocity", "gap", "front_distance", "sideways", "deceleration"):
            columns[name] += one.grid.cases[name].tolist() if name in one.grid.cases else [math.nan] * n
        columns["crash"] += one.crash.tolist()
        columns["failed"] += one.failed.tolist()
        columns["impact_speed"] += one.impact_speed.tolist()
        columns["ttc_min"] += one.ttc_min.tolist()
        for name in DRIVERS:
            known = has_driver(one.grid.manoeuvre, name) and is_comparable(one, name)
            avoided = (~reference(one.grid, name).crash).tolist() if known else [None] * n
            columns[f"preventable_{name}"] += avoided
    return arrow_table(ALKS_COLUMNS, columns)


def boundary(
    found: Verdicts, *, workers: int | None = None, on_cases: Callable[[int], None] | None = None
) -> list[dict[str, float]]:
    """Where the cases end that a driver avoids, by bisection between the cases of the grid.

    Args:
        found: The verdicts on the grid, which are not found again; a case in which a planner fails is not avoided.
        workers: Processes that drive a planner; None: one per core.
        on_cases: Called with the number of further cases that are driven, before they are.

    Returns:
        The numbers of each boundary to 0.1: of cut-ins and cut-outs per speeds and sideways speed the least `gap` (or
        `front_distance`, to what stands) from which on all are avoided [m], 0 if all of the grid are, inf if the last
        one is not; of followings per speed the largest `deceleration` up to which all are [m/s²], inf if all of the
        grid are, 0 if not even the least one is.
    """
    cases, along = found.grid.cases, _ALONG[found.grid.manoeuvre]
    others = [name for name in cases if name != along]
    keys, which = np.unique(np.column_stack([cases[name] for name in others]), axis=0, return_inverse=True)
    which = which.reshape(-1)
    # What is easier has larger numbers: farther away, or braking less.
    sign = -1.0 if along == "deceleration" else 1.0
    ease, is_hit = sign * cases[along], found.crash | found.failed
    low, high = np.full(len(keys), -math.inf), np.full(len(keys), math.inf)
    for key in range(len(keys)):
        here = which == key
        low[key] = ease[here & is_hit].max(initial=-math.inf)
        high[key] = ease[here & (ease > low[key])].min(initial=math.inf)
    while True:
        wide = np.isfinite(low) & np.isfinite(high) & (high - low > _ALONG_STEP)
        if not wide.any():
            break
        if on_cases is not None:
            on_cases(int(wide.sum()))
        middle = 0.5 * (low[wide] + high[wide])
        between = {**dict(zip(others, keys[wide].T, strict=True)), along: sign * middle}
        again = _again(found, {name: between[name] for name in cases}, workers)
        low[wide], high[wide] = np.where(again, middle, low[wide]), np.where(again, high[wide], middle)
    everything, nothing = (0.0, math.inf) if sign > 0.0 else (math.inf, 0.0)
    bounds = np.where(np.isneginf(low), everything, np.where(np.isposinf(high), nothing, sign * high))
    return [
        {**dict(zip(others, key, strict=True)), along: bound}
        for key, bound in zip(keys.tolist(), bounds.tolist(), strict=True)
    ]


def _again(found: Verdicts, cases: dict[str, Floats], workers: int | None) -> Bools:
    """Whether the driver of these verdicts hits the other, or fails, in other cases."""
    grid = Grid(found.grid.manoeuvre, cases)
    if not found.planner:
        return reference(grid, found.driver).crash
    more = driven(grid, found.planner, predictor=found.predictor, workers=workers)
    return more.crash | more.failed


def _law(manoeuvre: str) -> Callable[..., Endings]:
    laws: dict[str, Callable[..., Endings]] = {
        "cut_in": cut_in,
        "cut_out": cut_out,
        "following": car_following,
    }
    return laws[manoeuvre]


def _drive(manoeuvre: str, planner: str, predictor: str, cases: Sequence[dict[str, float]]) -> list[_Ending]:
    """The ending of each case with a planner."""
    return [_ending(_driven(manoeuvre, planner, predictor, case)) for case in cases]


def _driven(manoeuvre: str, planner: str, predictor: str, case: dict[str, float]) -> Simulation:
    """The simulation of a case at its end. It is not recorded: violations and reasons take as long as driving."""
    velocity = case["velocity"]
    if manoeuvre == "cut_in":
        lateral = (worlds.LANE + 1.0) / case["sideways"] if case["sideways"] > 0.0 else 0.0
        ramp = case["sideways"] / worlds.SIDEWAYS_ACCELERATION
        time = max(lateral, case["gap"] / (velocity - case["other_velocity"])) + ramp
        tracks = worlds.cut_in(case, _steps(time))
    else:
        # The careful and competent driver keeps 2 s to a leader: every planner begins there.
        kept = 2.0 * velocity
        if manoeuvre == "cut_out":
            time = (kept + case["front_distance"]) / max(velocity, 1.0) + 2.0
            tracks = worlds.cut_out(case, _steps(time), kept)
        else:
            tracks = worlds.car_following(case, _steps(velocity / case["deceleration"]), kept)
    simulation = Simulation(
        worlds.scenario(f"alks_{manoeuvre}", tracks, velocity),
        agents=[worlds.EGO],
        planner=planner,
        predictor=predictor,
        settings={"view.sensor_radius": SENSOR_RADIUS, "step.grace_factor": 1.0},
        threads=1,
    )
    while not simulation.is_done:
        simulation.step()
    return simulation


def _steps(time: float) -> int:
    return min(_STEPS_MAX, int((time + _AFTERWARDS) / worlds.DT))


def _ending(simulation: Simulation) -> _Ending:
    ended, states = simulation.outcomes(), simulation.states()
    crash = ended.outcome[0] == "collision" and int(ended.partner_id[0]) >= 0
    row = int(np.searchsorted(states.participant_id, worlds.EGO))
    least = math.inf
    for other in range(len(states.participant_id)):
        if other == row:
            continue
        gap = states.x[other] - states.x[row] - 0.5 * (states.length[other] + states.length[row])
        closing = states.velocity[row] - states.velocity[other] * np.cos(states.orientation[other])
        in_way = np.abs(states.y[other] - states.y[row]) < 0.5 * (states.width[other] + states.width[row])
        counts = states.valid[row] & states.valid[other] & in_way & (gap >= 0.0) & (closing > 0.0)
        if counts.any():
            least = min(least, float((gap[counts] / closing[counts]).min()))
    failed = not crash and ended.outcome[0] in _FAILED
    return crash, float(ended.impact_speed[0]) if crash else math.nan, least, failed
