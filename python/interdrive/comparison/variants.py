"""The compared planners with their distinguishing settings, and the agents that all of them drove."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.batches.plan import ALONE, TRAFFIC
from interdrive.errors import InputError, ResultsError
from interdrive.planners import RECORDED_PATH

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from interdrive.storage import ArrowTable

    Rows = dict[str, Any]
    Flags = NDArray[np.bool_]

#: Stands for all categories together.
ALL = "all"

#: What is said of rows of replayed humans that are left out.
NOT_JUDGED, REPLAYED = "planner recorded among reacting traffic is not judged", "replayed humans do not react"

_OTHERS = {
    "recorded": "all others replay their recording",
    "velocity_adjusting": "all others keep to their path and adjust their speed",
    "same": "all others drive with it, too",
}


@dataclass(frozen=True)
class ComparedSet:
    """Runs that can be compared with each other: same traffic, same choice of agents.

    Attributes:
        traffic: What vehicles do that are not under test.
        agents: Agents under test.
        variants: Planners, in order.
        drivers: Those of them that finished a run.
        n_scenarios: Scenarios of the agents that all of them drove.
        n_agents: Agents that all of them drove; table and differences contain no others.
        left_out: Per variant, agents that it drove and another one did not.
        n_places: Places, files or agents that intervals draw.
        n_repeated: Rows of agents whose seed drew the same agents of a scenario as an earlier one.
    """

    traffic: str
    agents: str
    variants: tuple[str, ...]
    drivers: tuple[str, ...]
    n_scenarios: int
    n_agents: int
    left_out: Mapping[str, int]
    n_repeated: int = 0
    n_places: int = 0

    @property
    def title(self) -> str:
        """The set in words."""
        if self.agents == ALL:
            return "Every vehicle has the planner under test"
        one = self.agents in (ALONE, "1")
        who = "One vehicle at a time has" if one else f"At most {self.agents} vehicles per scenario have"
        return f"{who} the planner under test, {_OTHERS[self.traffic]}"

    @property
    def size(self) -> str:
        """The number of compared agents, and which are left out and why."""
        scenarios = f"{self.n_scenarios} scenario{'s' * (self.n_scenarios != 1)}"
        text = f"{self.n_agents} agents in {scenarios}"
        if any(self.left_out.values()):
            counts = ", ".join(f"{variant} {count}" for variant, count in self.left_out.items() if count)
            text += f", driven by all {len(self.drivers)} planners; not counted: {counts}"
        if self.n_repeated:
            text += f"; {self.n_repeated} rows are not counted, as their seeds drew the same agents as earlier ones"
        return text


def rows_of(table: ArrowTable) -> Rows:
    """The rows of a batch that planners are judged by, as numpy arrays, with `unable`.

    A planner that cannot drive an agent has no row for it: where the default planner drove a vehicle without recording
    in place of a planner that follows recordings, the agent is not under test but `unable`. Replayed humans do not
    react, so the planner `recorded` has rows among replayed traffic only.

    Raises:
        ResultsError: There are no others.
    """
    rows = arrays(table)
    own, planner = rows["agent_planner"].astype(str), rows["planner"].astype(str)
    driven = (rows["status"].astype(str) == "finished") & ~np.isnan(rows["agent_id"].astype(np.float64))
    rows["unable"] = driven & np.isin(planner, RECORDED_PATH) & ~np.isin(own, RECORDED_PATH)
    rows["under_test"] = np.where(rows["unable"], 0, rows["under_test"])
    shown = ~_replayed_among_reacting(rows)
    if len(shown) and not shown.any():
        raise ResultsError(f"{NOT_JUDGED}: {REPLAYED}")
    return _only(rows, shown)


def left_out_humans(table: ArrowTable) -> bool:
    """Whether `rows_of` leaves out rows of the planner `recorded` among reacting traffic."""
    return bool(_replayed_among_reacting(arrays(table.select(["planner", "traffic"]))).any())


def _replayed_among_reacting(rows: Mapping[str, Any]) -> Flags:
    found: Flags = (rows["planner"].astype(str) == "recorded") & (rows["traffic"].astype(str) == "velocity_adjusting")
    return found


def arrays(table: ArrowTable) -> Rows:
    """The columns as numpy arrays; absent numbers are nan, texts are objects."""
    found: Rows = {}
    for name in table.column_names:
        found[name] = np.array(table[name].to_pylist())
        if found[name].dtype == object and not any(isinstance(item, str) for item in found[name]):
            found[name] = np.array([np.nan if item is None else item for item in found[name]], dtype=np.float64)
        elif found[name].dtype.kind == "U":
            found[name] = found[name].astype(object)
    return found


def chosen(rows: Rows, planners: Sequence[str] | None) -> Rows:
    """The rows of these planners; of all if none are named.

    Raises:
        InputError: No run has such a planner.
    """
    if planners is None:
        return rows
    there = sorted(set(rows["planner"]))
    for planner in planners:
        if planner not in there:
            raise InputError(f"planner {planner}: no run of this batch has it; there are {', '.join(there)}")
    return _only(rows, np.isin(rows["planner"].astype(str), list(planners)))


def variants_of(rows: Mapping[str, Any]) -> NDArray[np.object_]:
    """What is compared, per row: the planner with whatever else is not the same in all rows.

    That is the predictor, settings that are not the defaults, and the version of interdrive.
    """
    several = {name: len(set(rows[name])) > 1 for name in ("predictor", "settings", "version")}

    def named(planner: str, predictor: str, settings: str, version: str) -> str:
        name = f"{planner} + {predictor}" if several["predictor"] else planner
        if several["settings"] and settings:
            name += f", {settings}"
        return f"{name}, version {version}" if several["version"] else name

    columns = (rows[name] for name in ("planner", "predictor", "settings", "version"))
    return np.array([named(*map(str, row)) for row in zip(*columns, strict=True)], dtype=object)


def categories_of(rows: Mapping[str, Any]) -> NDArray[np.object_]:
    """The category of every row's scenario: of the categories of its runs, the shortest, then the first by alphabet.

    The category of a run says below which folder its scenario was found, and differs where another one was given.
    """
    found: dict[str, str] = {}
    for scenario, category in zip(rows["scenario_sha256"], rows["category"], strict=True):
        found[scenario] = min(found.get(scenario, category), category, key=lambda name: (len(name), name))
    return np.array([found[scenario] for scenario in rows["scenario_sha256"]], dtype=object)


def compared_sets(rows: Rows) -> Iterator[tuple[ComparedSet, Rows]]:
    """Sets in which a run has finished, and their rows with `counts`, `drawn` and `draw`.

    `drawn` says which rows are agents under test, each once per driver, `counts` which of them all drivers drove.
    `draw` is the first seed that chose the same agents of a scenario: later ones repeat the same run, and their agents
    count once.

    Args:
        rows: Columns of the data set as arrays, with `variant`.

    Raises:
        ResultsError: A variant drove the same agent in several runs, which nothing in the data tells apart.
    """
    settings = set(zip(rows["traffic"], rows["agents"], strict=True))
    for traffic, agents in sorted(settings, key=lambda item: (-TRAFFIC.index(item[0]), item[1])):
        here = _only(rows, (rows["traffic"] == traffic) & (rows["agents"] == agents))
        tested = here["under_test"] == 1
        variants, drivers = (tuple(sorted(set(here["variant"][who]))) for who in (here["status"] != "refused", tested))
        if not drivers:
            continue
        here["draw"] = _draws(here, tested)
        driven = {variant: _agents(here, tested & (here["variant"] == variant), variant) for variant in drivers}
        common = set.intersection(*map(set, driven.values()))
        here["counts"], here["drawn"] = np.zeros(len(tested), dtype=np.bool_), np.zeros(len(tested), dtype=np.bool_)
        for who in driven.values():
            here["drawn"][[*who.values()]] = True
            here["counts"][[row for agent, row in who.items() if agent in common]] = True
        left_out = {variant: len(who) - len(common) for variant, who in driven.items()}
        n_scenarios, n_repeated = (
            len({agent[0] for agent in common}),
            int(tested.sum()) - sum(map(len, driven.values())),
        )
        yield ComparedSet(traffic, agents, variants, drivers, n_scenarios, len(common), left_out, n_repeated), here


def by_category(rows: Rows) -> Iterator[tuple[str, Rows]]:
    """All rows of a set, then those of every category with agents that count."""
    categories = sorted(set(rows["category"][rows["counts"]]))
    for category in [ALL, *categories] if len(categories) > 1 else [ALL]:
        yield category, rows if category == ALL else _only(rows, rows["category"] == category)


def _only(rows: Rows, which: Flags) -> Rows:
    return {name: values[which] for name, values in rows.items()}


def _draws(rows: Rows, tested: Flags) -> NDArray[np.int64]:
    """Per row the first seed whose run tests the same agents; 0 for rows without an agent under test."""
    under_test: dict[str, set[int]] = {}
    chosen_rows = np.flatnonzero(tested).tolist()
    for row in chosen_rows:
        under_test.setdefault(rows["key"][row], set()).add(int(rows["agent_id"][row]))
    who = {row: (rows["scenario_sha256"][row], frozenset(under_test[rows["key"][row]])) for row in chosen_rows}
    first: dict[tuple[str, frozenset[int]], int] = {}
    for row, ids in who.items():
        first[ids] = min(first.get(ids, int(rows["seed"][row])), int(rows["seed"][row]))
    draws = np.zeros(len(tested), dtype=np.int64)
    draws[chosen_rows] = [first[who[row]] for row in chosen_rows]
    return draws


def _agents(rows: Rows, which: Flags, variant: str) -> dict[tuple[str, int, int], int]:
    """Row by scenario, draw and agent."""
    found: dict[tuple[str, int, int], int] = {}
    for row in np.flatnonzero(which).tolist():
        agent = (rows["scenario_sha256"][row], int(rows["draw"][row]), int(rows["agent_id"][row]))
        if agent in found and rows["seed"][row] != rows["seed"][found[agent]]:
            continue  # another seed, the same agents
        if agent in found:
            raise ResultsError(
                f"{variant} drove agent {agent[2]} of {rows['scenario'][row]} in several runs that cannot be told "
                "apart (a planner's module, a library that it needs, or a file that belongs to the scenario, such as "
                "its map, was changed); use a folder for each"
            )
        found[agent] = row
    return found
