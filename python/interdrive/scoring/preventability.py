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

#: Drivers are followed for this long after the contact [s].
AFTERWARDS = 3.0

_PEOPLE = ("pedestrian",)

#: Why there is no verdict, in words; {} is the partner.
UNDEFINED = {
    "stood": "the agent stood: no driver could have braked",
    "reversed": "the agent reversed: UN R157 has no reference driver for that",
    "crossing": "UN R157 has no reference driver for crossing traffic",
    "oncoming": "UN R157 has no reference driver for oncoming traffic",
    "pedestrian": "UN R157 has no reference driver for pedestrians",
    "behind": "hit from behind by {}: braking would not have avoided it",
}

_WHO = {
    "cc": "a careful and competent driver (UN R157)",
    "r157": "the minimum of UN R157, 5.2.5.2",
    "rss": "a driver by RSS",
    "fsm": "a driver by the fuzzy safety model",
}

#: How the partner came to be in the agent's way, in words; {} is the partner, then the time [s].
ENTRIES = {
    "ahead": "{} was in the agent's way from {} s on, when both were there first",
    "partner": "{} came into the agent's way at {} s",
    "agent": "the agent left its lane into the way of {} at {} s",
    "both": "the ways of the agent and {} met at {} s",
}

_TABLE, _DRIVES = "preventability.parquet", "preventability_drives.parquet"
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
    Column(
        "entry",
        "label",
        "how the partner came into the agent's way: it was ahead at the first common step, it left its lane, the agent "
        "left its own, or both or neither did",
        labels=tuple(ENTRIES),
    ),
    Column("from_time_step", "integer", "time step at which the drivers take over, before the contact"),
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
    Column("words", "text", "the verdicts in words, above all that on `cc`"),
)

#: Columns of the table of drives.
DRIVE_COLUMNS = (
    Column("agent_id", "integer", "participant id of the agent"),
    Column("partner_id", "integer", "participant id of the other"),
    Column("kind", "label", "what happened", labels=("collision", "near_miss")),
    Column("driver", "label", "the reference driver", labels=tuple(DRIVERS)),
    Column("time", "number", "from the beginning of the recording", "s"),
    Column("x", "number", "centre of the footprint", "m"),
    Column("y", "number", "centre of the footprint", "m"),
    Column("orientation", "number", "heading", "rad"),
    Column("velocity", "number", "along the heading", "m/s"),
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
        entry: How the partner came into the agent's way, a key of `ENTRIES`.
        from_time_step: Time step at which the drivers take over, before the contact.
        velocity: Speed of the agent then [m/s].
        preventable: By driver, whether it would not have hit the partner: 1 or 0, nan without a verdict.
        impact_speed: By driver, difference of the velocities at its contact [m/s]; nan without a contact.
        distance: By driver, the least distance that it keeps [m], 0 with a contact; nan without a verdict.
        words: The verdicts in words, above all that on `cc`.
        origin: How the verdicts came about.
    """

    agent_id: Ints
    partner_id: Ints
    kind: tuple[str, ...]
    time_step: Ints
    undefined: tuple[str, ...]
    entry: tuple[str, ...]
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
            "entry": self.entry,
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

    def drives_to_arrow(self) -> ArrowTable:
        """The drives on which the verdicts rest, one row per point, as an Arrow table with `DRIVE_COLUMNS`."""
        columns: dict[str, list[object]] = {column.name: [] for column in DRIVE_COLUMNS}
        about = list(zip(self.agent_id.tolist(), self.partner_id.tolist(), self.kind, strict=True))
        for row, whose in enumerate(about):
            for name in DRIVERS:
                drive = self.witness(row, name)
                if drive is None:
                    continue
                n = len(drive.time)
                for column, value in zip(("agent_id", "partner_id", "kind", "driver"), (*whose, name), strict=True):
                    columns[column] += [value] * n
                for column in ("time", *_WITNESS):
                    columns[column] += getattr(drive, column).tolist()
        return arrow_table(DRIVE_COLUMNS, columns)

    def save(self, folder: str | Path) -> Path:
        """Writes preventability.parquet and preventability_drives.parquet into a `folder`; older ones are replaced.

        Returns:
            The path of the first.

        Raises:
            ResultsError: A file cannot be written; one line with path and cause.
        """
        path = Path(folder) / _TABLE
        for target, table in ((Path(folder) / _DRIVES, self.drives_to_arrow()), (path, self.to_arrow())):
            with replacing(target) as partial:
                write_table(table, partial, self.origin)
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
    words = tuple(_words(run, conflicts[row], found, row, witnesses["cc"][row]) for row in range(len(conflicts)))
    return Preventability(
        agent_id=np.array([each[0] for each in conflicts], dtype=np.int64),
        partner_id=np.array([each[1] for each in conflicts], dtype=np.int64),
        kind=tuple(each[3] for each in conflicts),
        time_step=np.array([each[2] for each in conflicts], dtype=np.int64),
        undefined=tuple(found["undefined"]),
        entry=tuple(found["entry"]),
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


_WITNESS = ("x", "y", "orientation", "velocity")


def _witness(found: dict[str, Any], start: float) -> Witness:
    n = len(found["velocity"])
    return Witness(start + found["step"] * np.arange(n), **{name: found[name] for name in _WITNESS})


def _words(
    run: RunRecord,
    conflict: _Conflict,
    found: dict[str, Any],
    row: int,
    witness: Witness,
) -> str:
    """The verdict on the careful and competent driver, and in short those on the others."""
    _, whom, time_step, kind, _ = conflict
    if found["undefined"][row]:
        return UNDEFINED[found["undefined"][row]].format(whom)
    dt = run.scenario.dt
    what = "this collision" if kind == "collision" else "coming so near"
    entered = ENTRIES[found["entry"][row]].format(whom, said_seconds(int(found["from_time_step"][row]), dt))
    velocity, time = float(found["velocity"][row]), float(found["time"][row])
    before = f"{time:.1f}" if time >= 0.1 else f"{time:.2f}"
    is_avoided = found["preventable"][row] == 1.0
    verdict = "would" if is_avoided[0] else "would not"
    said = (
        f"{_WHO['cc']} {verdict} have avoided {what} at {said_seconds(time_step, dt)} s: {entered}, {before} s before"
    )
    if is_avoided[0]:
        end = float(witness.velocity[-1])
        rest = "a standstill" if end == 0.0 else f"{end:.1f} m/s"
        said += (
            f"; braking from {velocity:.1f} m/s to {rest} keeps {found['distance'][row][0]:.1f} m from {whom} at least"
        )
    else:
        said += f"; that driver would have hit {whom} with {found['impact_speed'][row][0]:.1f} m/s"
    others = list(zip(DRIVERS, is_avoided, found["impact_speed"][row], strict=True))[1:]
    same = [name for name, avoids, _ in others if avoids == is_avoided[0]]
    # The impact speed says how far those are off that would have hit it.
    differ = [name if avoids else f"{name} ({speed:.1f} m/s)" for name, avoids, speed in others if name not in same]
    too = f"so would {_and(same)}" if is_avoided[0] else f"nor would {_and(same, 'or')}"
    other = f"{_and(differ)} would {'not' if is_avoided[0] else 'have'}"
    return "; ".join([said, *([too] if same else []), *([other] if differ else [])])


def _and(names: Sequence[str], word: str = "and") -> str:
    return f" {word} ".join([part for part in (", ".join(names[:-1]), names[-1] if names else "") if part])
