"""What reference drivers in an agent's place would have avoided: for each collision and near miss of a run."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from interdrive.errors import InputError
from interdrive.reference_drivers import DRIVERS
from interdrive.run.goals import said_seconds
from interdrive.scoring.drives import rear_axle_to_center, site_of, traffic, window_of
from interdrive.scoring.settings import ScoringSettings
from interdrive.storage import Column, Origin, arrow_table, replacing, write_table

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from typing import Any

    from interdrive import _core
    from interdrive.array_types import Floats, Ints
    from interdrive.run import RunRecord
    from interdrive.storage import ArrowTable

_PEOPLE = ("pedestrian",)

#: Why there is no verdict, in words; {} is the partner.
UNDEFINED = {
    "stood": "the agent stood: no driver could have braked",
    "reversed": "the agent reversed: UN R157 has no reference driver for that",
    "crossing": "UN R157 has no reference driver for crossing traffic",
    "pedestrian": "UN R157 has no reference driver for pedestrians",
    "behind": "hit from behind by {}: braking would not have avoided it",
}

_WHO = {
    "cc": "a careful and competent driver (UN R157)",
    "r157": "the minimum of UN R157, 5.2.5.2",
    "rss": "a driver by RSS",
    "fsm": "a driver by the fuzzy safety model",
}

_TABLE = "preventability.parquet"
_NO_VERDICT = "there is no verdict"
_NO_CONTACT = "the driver does not hit it, or there is no verdict"

#: Columns of the verdicts by driver, which scores of agents have, too.
PREVENTABLE = {
    name: Column(f"preventable_{name}", "truth", f"{_WHO[name]} would not have hit it", null=_NO_VERDICT)
    for name in DRIVERS
}

#: Columns of the table.
PREVENTABILITY_COLUMNS = (
    Column("agent_id", "integer", "participant id of the agent"),
    Column("partner_id", "integer", "participant id of the other"),
    Column("kind", "label", "what happened", labels=("collision", "near_miss")),
    Column("time_step", "integer", "of the first states after the contact, or of the near miss"),
    Column("undefined", "label", "why there is no verdict; empty: there is one", labels=("", *UNDEFINED)),
    Column("from_time_step", "integer", "time step at which the drivers take over"),
    Column("velocity", "number", "of the agent then", "m/s"),
    *(
        column
        for name in DRIVERS
        for column in (
            PREVENTABLE[name],
            Column(
                f"impact_speed_{name}", "number", "difference of the velocities at its contact", "m/s", null=_NO_CONTACT
            ),
            Column(f"distance_{name}", "number", "least distance that it keeps", "m", null=_NO_VERDICT),
        )
    ),
    Column("words", "text", "the verdict on `cc` in words"),
)


@dataclass(frozen=True)
class Witness:
    """What a reference driver would have done; arrays of shape (points,), `dt` seconds apart.

    Attributes:
        time: From the beginning of the recording [s].
        x: Centre of the footprint [m]. y: The same [m].
        orientation: Heading [rad].
        velocity: Along the heading [m/s].
    """

    time: Floats
    x: Floats
    y: Floats
    orientation: Floats
    velocity: Floats


@dataclass(frozen=True)
class Preventability:
    """Verdicts on collisions and near misses of a run; arrays of shape (conflicts,), sorted by agent.

    Attributes:
        agent_id: Agents.
        partner_id: Their partners.
        kind: "collision" or "near_miss".
        time_step: Of the first states after the contact, or of the near miss.
        undefined: Why there is no verdict, a key of `UNDEFINED`; "" if there is one.
        from_time_step: Time step at which the drivers take over.
        velocity: Speed of the agent then [m/s].
        preventable: By driver, whether it would not have hit the partner: 1 or 0, nan without a verdict.
        impact_speed: By driver, difference of the velocities at its contact [m/s]; nan without a contact.
        distance: By driver, the least distance that it keeps [m], 0 with a contact; nan without a verdict.
        words: The verdict on `cc`, in words.
        origin: How the verdicts came about.
    """

    agent_id: Ints
    partner_id: Ints
    kind: tuple[str, ...]
    time_step: Ints
    undefined: tuple[str, ...]
    from_time_step: Ints
    velocity: Floats
    preventable: dict[str, Floats]
    impact_speed: dict[str, Floats]
    distance: dict[str, Floats]
    words: tuple[str, ...]
    origin: Origin = field(default_factory=Origin)
    _witnesses: dict[str, tuple[Witness, ...]] = field(default_factory=dict, repr=False)

    def __len__(self) -> int:
        return len(self.kind)

    def witness(self, row: int, driver: str) -> Witness | None:
        """What a driver would have done from `from_time_step` to its contact, or 3 s beyond that of the agent.

        Args:
            row: Row of the conflict.
            driver: One of `interdrive.reference_drivers.DRIVERS`.

        Returns:
            The drive; None without a verdict.

        Raises:
            InputError: There is no such driver.
        """
        if driver not in DRIVERS:
            raise InputError(f"there is no reference driver {driver}; there are {', '.join(DRIVERS)}")
        found = self._witnesses[driver][row]
        return found if len(found.time) else None

    def to_arrow(self) -> ArrowTable:
        """One row per conflict, as an Arrow table."""
        columns: dict[str, Any] = {
            "agent_id": self.agent_id,
            "partner_id": self.partner_id,
            "kind": self.kind,
            "time_step": self.time_step,
            "undefined": self.undefined,
            "from_time_step": self.from_time_step,
            "velocity": self.velocity,
            "words": self.words,
        }
        for name in DRIVERS:
            known = [None if math.isnan(value) else bool(value) for value in self.preventable[name].tolist()]
            columns[f"preventable_{name}"] = known
            columns[f"impact_speed_{name}"] = self.impact_speed[name]
            columns[f"distance_{name}"] = self.distance[name]
        return arrow_table(PREVENTABILITY_COLUMNS, columns)

    def save(self, folder: str | Path) -> Path:
        """Writes preventability.parquet into a `folder`; an older one is replaced.

        Raises:
            ResultsError: The file cannot be written; one line with path and cause.
        """
        path = Path(folder) / _TABLE
        with replacing(path) as partial:
            write_table(self.to_arrow(), partial, self.origin)
        return path


def preventability(
    run: RunRecord, ids: Sequence[int] | None = None, settings: ScoringSettings | None = None
) -> Preventability:
    """Whether reference drivers would have avoided each collision and near miss of a run, from its stored states.

    The agent's own track is the path, straight on beyond its end; the others drive as they drove, and after their last
    states they keep speed and heading. From the time step at which the partner enters the agent's way, a driver takes
    over with the agent's speed, and brakes after its delay.

    Args:
        run: A run, as `simulate` and `load` give it.
        ids: Agents; None: all.
        settings: Bounds of near misses; the defaults otherwise.

    Raises:
        InputError: An id that is not an agent of the run.
    """
    chosen = settings or ScoringSettings()
    known = run.outcomes.agent_id.tolist()
    wanted = sorted(set(known if ids is None else ids))
    strangers = [number for number in wanted if number not in known]
    if strangers:
        raise InputError(f"preventability: {strangers[0]} is not an agent of this run")
    simulated = traffic(site_of(run, run.settings.get("settings") or {}), run)
    conflicts = sorted(_conflicts(run, simulated, wanted, chosen))
    found = simulated.preventability([(*each[:3], each[3] == "collision", each[4]) for each in conflicts])
    numbers = {
        name: dict(zip(DRIVERS, np.ascontiguousarray(found[name].T), strict=True))
        for name in ("preventable", "impact_speed", "distance")
    }
    dt, first = run.scenario.dt, found["from_time_step"]
    witnesses = {
        name: tuple(
            _witness(each, float(start) * dt) for each, start in zip(found["witness"][name], first, strict=True)
        )
        for name in DRIVERS
    }
    rows = range(len(conflicts))
    words = tuple(
        _words(
            conflicts[row],
            found["undefined"][row],
            (float(found["velocity"][row]), float(found["time"][row])),
            {name: float(numbers[name]["cc"][row]) for name in numbers},
            witnesses["cc"][row],
            said_seconds(conflicts[row][2], dt),
        )
        for row in rows
    )
    return Preventability(
        agent_id=np.array([each[0] for each in conflicts], dtype=np.int64),
        partner_id=np.array([each[1] for each in conflicts], dtype=np.int64),
        kind=tuple(each[3] for each in conflicts),
        time_step=np.array([each[2] for each in conflicts], dtype=np.int64),
        undefined=tuple(found["undefined"]),
        from_time_step=first,
        velocity=found["velocity"],
        preventable=numbers["preventable"],
        impact_speed=numbers["impact_speed"],
        distance=numbers["distance"],
        words=words,
        origin=Origin({}, {"scenario": run.scenario.sha256, "run": run.digest}),
        _witnesses=witnesses,
    )


def preventable_collisions(
    run: RunRecord, simulated: _core.Traffic, wanted: Sequence[int]
) -> dict[int, dict[str, float]]:
    """Of agents that collided with another participant: by driver, whether it would not have: 1, 0, nan: no verdict.

    Args:
        run: The run.
        simulated: Its traffic.
        wanted: Agents; those without such a collision are left out.
    """
    conflicts = sorted(_collisions(run, wanted))
    if not conflicts:
        return {}
    found = simulated.preventability([(*each[:3], True, each[4]) for each in conflicts])["preventable"]
    return {each[0]: dict(zip(DRIVERS, row, strict=True)) for each, row in zip(conflicts, found.tolist(), strict=True)}


_Conflict: TypeAlias = "tuple[int, int, int, str, bool]"


def _conflicts(
    run: RunRecord, simulated: _core.Traffic, wanted: Sequence[int], settings: ScoringSettings
) -> Iterator[_Conflict]:
    """Agent, partner, time step, kind, and whether the partner is a pedestrian."""
    hits = {}
    for each in _collisions(run, wanted):
        hits[each[0]] = each[1]
        yield each
    states = run.states
    kinds = dict(zip(states.participant_id.tolist(), states.kinds, strict=True))
    lengths = dict(zip(states.participant_id.tolist(), states.length.tolist(), strict=True))
    axles = [rear_axle_to_center(lengths[number]) for number in wanted]
    times, partners = simulated.straight_times(list(wanted), axles, settings.ttc_horizon, 1)
    for row, who in enumerate(wanted):
        columns = window_of(states, int(np.searchsorted(states.participant_id, who)))
        # Both have to be there at the step before, too, from which they come.
        near = times[row, columns]
        if len(columns) and near.min() <= settings.ttc_bound:
            column = int(columns[near.argmin()])
            whom = int(partners[row, column])
            there = states.valid[np.searchsorted(states.participant_id, [who, whom])][:, column - 1 : column + 1]
            if whom != hits.get(who, -1) and there.all():
                yield who, whom, column + int(states.first_time_step), "near_miss", kinds[whom] in _PEOPLE


def _collisions(run: RunRecord, wanted: Sequence[int]) -> Iterator[_Conflict]:
    """The collisions among them."""
    ended, states = run.outcomes, run.states
    kinds = dict(zip(states.participant_id.tolist(), states.kinds, strict=True))
    rows = zip(ended.agent_id.tolist(), ended.partner_id.tolist(), ended.time_step.tolist(), ended.outcome, strict=True)
    for who, whom, when, how in rows:
        if how == "collision" and whom >= 0 and who in wanted:
            yield who, whom, when, "collision", kinds[whom] in _PEOPLE


def _witness(found: dict[str, Any], start: float) -> Witness:
    n = len(found["velocity"])
    return Witness(start + found["step"] * np.arange(n), **{name: found[name] for name in _WITNESS})


_WITNESS = ("x", "y", "orientation", "velocity")


def _words(
    conflict: tuple[int, int, int, str, bool],
    undefined: str,
    taken_over: tuple[float, float],
    numbers: dict[str, float],
    witness: Witness,
    when: str,
) -> str:
    """The verdict on the careful and competent driver."""
    _, whom, _, kind, _ = conflict
    if undefined:
        return UNDEFINED[undefined].format(whom)
    velocity, time = taken_over
    what = f"this collision at {when} s" if kind == "collision" else f"coming so near at {when} s"
    if numbers["preventable"] == 1.0:
        end = float(witness.velocity[-1])
        rest = "it stands" if end == 0.0 else f"it brakes to {end:.1f} m/s"
        keeps = f"{numbers['distance']:.1f} m from {whom} at least"
        return f"{_WHO['cc']} would have avoided {what}: from {velocity:.1f} m/s {rest}, {keeps}"
    speed = numbers["impact_speed"]
    return (
        f"{_WHO['cc']} would not have avoided {what}: {whom} came into its way {max(time, 0.0):.1f} s before, "
        f"and it would have hit it with {speed:.1f} m/s"
    )
