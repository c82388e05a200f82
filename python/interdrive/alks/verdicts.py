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
#: Gaps are found to this [m].
_GAP_STEP = 0.1

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
            f"preventable_{name}", "truth", f"`{name}` does not hit the other", null=f"`{name}` has no such manoeuvre"
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
    """

    grid: Grid
    driver: str
    crash: Bools
    impact_speed: Floats
    ttc_min: Floats
    failed: Bools


def has_driver(manoeuvre: str, driver: str) -> bool:
    """Whether a reference `driver` is defined for a `manoeuvre`."""
    return driver != "r157" or manoeuvre == "cut_in"


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
    return Verdicts(grid, name, table[:, 0] > 0.0, table[:, 1].copy(), table[:, 2].copy(), table[:, 3] > 0.0)


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
            known = has_driver(one.grid.manoeuvre, name)
            avoided = (~reference(one.grid, name).crash).tolist() if known else [None] * n
            columns[f"preventable_{name}"] += avoided
    return arrow_table(ALKS_COLUMNS, columns)


def boundary(grid: Grid, verdict: Callable[[dict[str, float]], bool]) -> list[dict[str, float]]:
    """The least gap from which on a driver avoids every case of the grid, per speeds and sideways speed.

    Args:
        grid: Cut-ins or cut-outs; in these the gap is the distance to what stands.
        verdict: Whether the driver hits the other in a case.

    Returns:
        The numbers of each boundary, with `gap` (or `front_distance`) to 0.1 m: 0 if all cases are avoided, inf if the
        last one is not.
    """
    along = "gap" if grid.manoeuvre == "cut_in" else "front_distance"
    others = [name for name in grid.cases if name != along]
    keys = sorted({tuple(float(grid.cases[name][row]) for name in others) for row in range(len(grid))})
    places: dict[tuple[float, ...], list[float]] = {key: [] for key in keys}
    for row in range(len(grid)):
        places[tuple(float(grid.cases[name][row]) for name in others)].append(float(grid.cases[along][row]))
    found = []
    for key in keys:
        case = dict(zip(others, key, strict=True))
        gaps = sorted(set(places[key]))
        hits = [gap for gap in gaps if verdict({**case, along: gap})]
        if not hits:
            low = high = 0.0
        elif hits[-1] == gaps[-1]:
            low = high = math.inf
        else:
            low, high = hits[-1], gaps[gaps.index(hits[-1]) + 1]
            while high - low > _GAP_STEP:
                middle = 0.5 * (low + high)
                low, high = (middle, high) if verdict({**case, along: middle}) else (low, middle)
        found.append({**case, along: high})
    return found


def hits(manoeuvre: str, driver: str, predictor: str | None = None) -> Callable[[dict[str, float]], bool]:
    """Whether a reference `driver` (without a `predictor`), or a planner, hits the other in a case of a `manoeuvre`."""
    if predictor is None:
        return lambda case: bool(_law(manoeuvre)(driver, **case).crash[0])
    return lambda case: _drive(manoeuvre, driver, predictor, [case])[0][0]


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
        time = max(lateral, case["gap"] / (velocity - case["other_velocity"])) + case["sideways"]
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
