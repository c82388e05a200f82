"""The score of agents against a panel: what its drivers reach in their place, and what others lose by them."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from interdrive import _core
from interdrive.errors import InputError, InterdriveError
from interdrive.panel.worlds import World
from interdrive.scoring import ScoringSettings, has_recording
from interdrive.scoring.drive_facts import Drive, drives_of
from interdrive.scoring.hindrance import Hindrance, hindrance_of
from interdrive.scoring.total import GATES, Facts, Total, total

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from interdrive.array_types import Ints
    from interdrive.runs import Run

#: The drivers of the panel: four that differ in design, each with its default settings.
PANEL = ("lawful", "idm", "idm_mobil", "rollout")

_SEVERAL = "several agents are scored: what each of them takes from the others is not measured"

#: Values above this are not worth a word; shorter stops neither [s].
_NEARLY_ONE, _STOOD_MIN = 0.995, 1.0


@dataclass(frozen=True)
class PanelDrives:
    """What can be reached in the place of one agent.

    Attributes:
        runs: By name of the driver. drives: The drives in them.
        hindrances: What others lose by each; empty where no vehicle can react.
        without: The world without the agent; None where no vehicle can react.
        notes: What the user should know.
    """

    runs: Mapping[str, Run] = field(default_factory=dict)
    drives: Mapping[str, Drive] = field(default_factory=dict)
    hindrances: Mapping[str, Hindrance] = field(default_factory=dict)
    without: Run | None = None
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class PanelScore:
    """Scores of agents against a panel; sequences in the order of `ids`.

    Attributes:
        ids: Agents, ascending.
        planners: Names of their planners.
        facts: What decided. totals: The scores with all their parts.
        hits: How often others hit them without their fault.
        hindrances: What others lost.
        reasons: In words, what made the score less than 1.
        panel: Drivers of the panel; empty: none, and scores are absolute.
        notes: One line per thing the user should know.
    """

    ids: Ints
    planners: tuple[str, ...]
    facts: tuple[Facts, ...]
    totals: tuple[Total, ...]
    hits: tuple[int, ...]
    hindrances: tuple[Hindrance, ...]
    reasons: tuple[tuple[str, ...], ...]
    panel: tuple[str, ...]
    notes: tuple[str, ...] = ()

    @property
    def score(self) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        """From 0 to 1."""
        return np.array([one.score for one in self.totals], dtype=np.float64)

    def __repr__(self) -> str:
        mean = f", mean {100.0 * float(self.score.mean()):.1f}" if len(self.ids) else ""
        return f"<PanelScore of {len(self.ids)} agents{mean}>"

    def why(self, agent_id: int) -> str:
        """Why the agent with id `agent_id` has no higher score, in one line.

        Raises:
            InputError: It was not scored.
        """
        rows = np.flatnonzero(self.ids == agent_id)
        if not len(rows):
            raise InputError(f"agent {agent_id} was not scored")
        return "; ".join(self.reasons[int(rows[0])]) or "full score"


def panel_score(
    run: Run,
    ids: Sequence[int] | None = None,
    settings: ScoringSettings | None = None,
    *,
    panel: Sequence[str] = PANEL,
    trust: bool = False,
    threads: int | None = 1,
    on_agent: Callable[[int, int], None] | None = None,
) -> PanelScore:
    """Scores agents of a run against a panel of drivers that drive in the place of each.

    The reference, page "Scores against a panel", defines all parts. Hindrance is measured if one agent is scored and
    others react; it is absent otherwise.

    Args:
        run: A run with its routes, as `simulate` and `load` give it.
        ids: Agents; None: all whose recordings overlap no others.
        settings: Bounds, weights and reactions; the defaults otherwise.
        panel: Names of native planners; empty: no panel, scores are absolute.
        trust: Import planners of other agents that the run names as module:object.
        threads: Number of planning threads; results do not depend on it.
        on_agent: Called after every agent with how many are done, and how many there are.

    Raises:
        InputError: An id is not that of an agent, or the run cannot be repeated.
    """
    chosen = settings or ScoringSettings()
    overlapping = run.scenario.overlapping
    wanted = sorted(set(run.outcomes.agent_id.tolist() if ids is None else ids) - set(overlapping))
    own = drives_of(run, wanted, chosen)
    if not has_recording(run):
        raise InputError("score: the scenario file is gone or has changed, so no driver can take the agents' place")
    notes = [_SEVERAL] if len(own) > 1 else []
    found = []
    for number in list(own):
        drive, place, driven = own[number], PanelDrives(), run
        if panel or len(own) == 1 or drive.hit:
            world = World.of(run, number, trust=trust, threads=threads)
            place = panel_drives(world, panel, chosen, measures_hindrance=len(own) == 1)
            drive, driven = _on_after_hits(drive, run, world, chosen)
        own[number] = drive
        found.append(judged(drive, driven, place, chosen))
        notes += [note for note in place.notes if note not in notes]
        if on_agent is not None:
            on_agent(len(found), len(own))
    return PanelScore(
        ids=np.array(list(own), dtype=np.int64),
        planners=tuple(drive.planner for drive in own.values()),
        facts=tuple(one[0] for one in found),
        totals=tuple(one[1] for one in found),
        hits=tuple(len(drive.hits) + bool(drive.hit) for drive in own.values()),
        hindrances=tuple(one[2] for one in found),
        reasons=tuple(one[3] for one in found),
        panel=tuple(panel),
        notes=tuple(notes),
    )


def _on_after_hits(drive: Drive, run: Run, world: World, settings: ScoringSettings) -> tuple[Drive, Run]:
    """The drive as it goes on after others hit the agent, and its run; as it is if nothing repeats it."""
    again = world.driven_on() if drive.hit else None
    if again is None:
        return drive, run
    on = drives_of(again, [drive.agent_id], settings)[drive.agent_id]
    n = len(drive.time)
    same = len(on.time) >= n and np.array_equal(on.s[:n], drive.s)
    return (on, again) if same and np.array_equal(on.velocity[:n], drive.velocity) else (drive, run)


def panel_drives(
    world: World, panel: Sequence[str], settings: ScoringSettings, *, measures_hindrance: bool
) -> PanelDrives:
    """Drives in the place of an agent, and the world without it."""
    without, notes = None, []
    if measures_hindrance and world.reacts:
        try:
            without = world.without_agent()
        except InterdriveError as error:
            notes.append(f"what others lose is not measured: the world without {world.agent_id} fails ({error})")
    runs, drives, hindrances = {}, {}, {}
    for name in panel:
        again = world.driven_by(name)
        drive = drives_of(again, [world.agent_id], settings).get(world.agent_id)
        if drive is None:
            continue
        runs[name], drives[name] = again, drive
        if without is not None:
            hindrances[name] = hindrance_of(drive, again, without)
    return PanelDrives(runs, drives, hindrances, without, tuple(notes))


def judged(
    drive: Drive, run: Run, place: PanelDrives, settings: ScoringSettings
) -> tuple[Facts, Total, Hindrance, tuple[str, ...]]:
    """Facts, score, what others lose, and reasons of one drive."""
    taken = Hindrance() if place.without is None else hindrance_of(drive, run, place.without)
    usual: list[set[int]] = [set(one.forced) for one in place.hindrances.values()]
    always = {number for number in taken.forced if usual and all(number in one for one in usual)}
    forced = set(taken.forced) - always
    panel = list(place.drives.values())
    facts = Facts(
        duration=drive.duration,
        way=drive.distance,
        free_flow=drive.free_flow,
        in_time=drive.in_time,
        arrived=drive.arrived,
        gates=_gates(drive, forced),
        ttc=drive.ttc.value,
        comfort=drive.comfort.value,
        lost=taken.lost,
        forced=bool(forced),
        panel_times=tuple(one.time_to(drive.distance) for one in panel),
        panel_arrived=any(one.arrived for one in panel),
        panel_gates=tuple(
            _gates(one, set(place.hindrances[name].forced) if name in place.hindrances else set())
            for name, one in place.drives.items()
        ),
        panel_ttc=tuple(one.ttc.value for one in panel),
        panel_comfort=tuple(one.comfort.value for one in panel),
        panel_lost=tuple(one.lost for one in place.hindrances.values()),
        panel_way=max((one.way_at(drive.duration) for one in panel), default=math.nan),
    )
    found = total(facts, settings.panel)
    return facts, found, taken, _reasons(drive, facts, found, (taken, forced), place)


def _gates(drive: Drive, forced: set[int]) -> dict[str, float]:
    """Gates with right of way decided: the vehicle that went first had to brake hard, or not."""
    gates = dict(drive.gates)
    if "right_of_way" in gates and not forced.isdisjoint(drive.cut_off_from):
        gates["right_of_way"] = 0.0
    return gates


def _reasons(
    drive: Drive, facts: Facts, found: Total, taken: tuple[Hindrance, set[int]], place: PanelDrives
) -> tuple[str, ...]:
    """One sentence per number that is less than 1, lowest first; then hits, and what was excused."""
    said: list[tuple[float, str]] = []
    for name in GATES:
        if found.gates[name] < 1.0 and (name != "speed" or found.gates[name] < _NEARLY_ONE):
            value = found.gates[name]
            more = " (counts half)" if value == 0.5 and name != "speed" else ""
            forced = ", which had to brake hard" if name == "right_of_way" and value == 0.0 else ""
            said.append((value, drive.words[name] + forced + more))
    if found.arrival < 1.0:
        did = _listed([name for name, one in place.drives.items() if one.arrived])
        said.append((found.arrival, f"did not arrive, where {did} did (counts half)"))
    if found.pace < _NEARLY_ONE:
        said.append((found.pace, _pace_words(drive, facts, found, place)))
    if found.hindrance < _NEARLY_ONE:
        said.append((found.hindrance, _hindrance_words(drive, found, taken, place)))
    for name, value, words in (
        ("time to contact straight on", found.ttc, drive.ttc.words),
        ("comfort", found.comfort, drive.comfort.words),
    ):
        if value < _NEARLY_ONE:
            said.append((value, f"{name} {value:.0f}: {words}"))
    reasons = [words for _, words in sorted(said, key=lambda one: one[0])]
    reasons += [f"hit by {by} at {when} s, not its fault: drove on" for by, when in drive.hits]
    if drive.hit:
        reasons.append(f"{drive.hit}, not its fault: counts as standing from then on")
    if found.excused:
        reasons.append(f"excused: {_listed(list(found.excused))}; no driver of the panel did better")
    return tuple(reasons)


def _pace_words(drive: Drive, facts: Facts, found: Total, place: PanelDrives) -> str:
    """How long it took, what others took, and where it stood."""
    took = f"pace {found.pace:.2f}: {drive.duration:.1f} s for {drive.distance:.0f} m"
    times = sorted(zip(facts.panel_times, place.drives, strict=True))
    reached = [(name, f"{time:.1f}") for time, name in times if math.isfinite(time)][:2]
    fast = [f"{name} took {time}" if k == 0 else f"{name} {time}" for k, (name, time) in enumerate(reached)]
    others = f"where {' and '.join(fast)} s" if fast else ""
    free = f"free flow takes {facts.free_flow:.1f} s"
    if not fast or facts.free_flow > found.yard:
        others = f"{others}, {free}" if others else free
    stood = _stood(drive)
    return ", ".join(part for part in (took, others) if part) + stood


def _stood(drive: Drive) -> str:
    """For how long it stood, and where longest."""
    still = np.abs(drive.velocity) <= _core.JUDGED_STANDSTILL_SPEED
    edges = np.flatnonzero(np.diff(np.concatenate([[False], still, [False]]).astype(np.int8)))
    spans = edges.reshape(-1, 2)
    if not len(spans):
        return ""
    longest = spans[int(np.argmax(spans[:, 1] - spans[:, 0]))]
    time = float(still.sum()) * drive.dt
    return f"; stood {time:.1f} s, longest at {drive.way[longest[0]]:.0f} m" if time >= _STOOD_MIN else ""


def _hindrance_words(drive: Drive, found: Total, taken: tuple[Hindrance, set[int]], place: PanelDrives) -> str:
    hindrance, forced = taken
    if forced:
        worst = max((hindrance.forced[number] for number in forced), key=lambda one: one.deceleration)
        when = f"{worst.time_step * drive.dt:.1f}"
        without = max(worst.without, 0.0)
        return (
            f"hindrance 0: {worst.participant_id} braked with {worst.deceleration:.1f} m/s² at {when} s, "
            f"with {without:.1f} m/s² without it"
        )
    vehicles = "1 vehicle" if len(hindrance.losers) == 1 else f"{len(hindrance.losers)} vehicles"
    lost = f"hindrance {found.hindrance:.2f}: {vehicles} lost {hindrance.lost:.1f} s"
    if not place.hindrances:
        return lost
    name, least = min(((name, one.lost) for name, one in place.hindrances.items()), key=lambda one: one[1])
    return f"{lost}, with {name} {least:.1f}"


def _listed(names: list[str]) -> str:
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)
