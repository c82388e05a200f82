"""The judgement of one drive against those of a panel in its place: facts, score, and why in words."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from interdrive import _core
from interdrive.scoring.hindrance import Hindrance
from interdrive.scoring.total import GATES, Facts, Total, total

if TYPE_CHECKING:
    from collections.abc import Mapping

    from interdrive.scoring.drive_facts import Drive
    from interdrive.scoring.hindrance import Undisturbed
    from interdrive.scoring.settings import ScoringSettings

#: Values above this are not worth a word; shorter stops neither [s].
_NEARLY_ONE, _STOOD_MIN = 0.995, 1.0


@dataclass(frozen=True)
class PanelDrives:
    """What can be reached in the place of one agent.

    Attributes:
        drives: By name of the driver.
        hindrances: What others lose by each; empty where no vehicle can react.
        without: The world without the agent; None where no vehicle can react.
        notes: What the user should know.
    """

    drives: Mapping[str, Drive] = field(default_factory=dict)
    hindrances: Mapping[str, Hindrance] = field(default_factory=dict)
    without: Undisturbed | None = None
    notes: tuple[str, ...] = ()


def judged(
    drive: Drive, taken: Hindrance, place: PanelDrives, settings: ScoringSettings
) -> tuple[Facts, Total, tuple[str, ...]]:
    """Facts, score and reasons of one drive, which takes something from others."""
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
    return facts, found, _reasons(drive, facts, found, (taken, forced), place)


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
        why = f": {drive.end}" if drive.end else ""
        said.append((found.arrival, f"did not arrive, where {did} did (counts half){why}"))
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
    reasons += [f"{hit}, not its fault: drove on" for hit in drive.hits]
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
    time = float((spans[:, 1] - spans[:, 0] - 1).sum()) * drive.dt
    return f"; stood {time:.1f} s, longest at {drive.way[longest[0]]:.0f} m" if time >= _STOOD_MIN else ""


def _hindrance_words(drive: Drive, found: Total, taken: tuple[Hindrance, set[int]], place: PanelDrives) -> str:
    hindrance, forced = taken
    if forced:
        worst = max((hindrance.forced[number] for number in forced), key=lambda one: one.deceleration)
        when = f"{worst.time_step * drive.dt:.1f}"
        without = max(worst.without, 0.0)
        return (
            f"hindrance 0: {worst.participant_id} braked with {worst.deceleration:.1f} m/s² at {when} s, "
            f"with {without:.1f} m/s² in the world without {drive.agent_id}"
        )
    vehicles = "1 vehicle" if len(hindrance.losers) == 1 else f"{len(hindrance.losers)} vehicles"
    lost = f"hindrance {found.hindrance:.2f}: {vehicles} lost {hindrance.lost:.1f} s"
    if not place.hindrances:
        return lost
    name, least = min(((name, one.lost) for name, one in place.hindrances.items()), key=lambda one: one[1])
    return f"{lost}, with {name} {least:.1f}"


def _listed(names: list[str]) -> str:
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)
