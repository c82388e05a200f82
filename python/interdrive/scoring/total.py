"""The score against a panel: a pure function of what is known of one drive and of the drives of the panel."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from interdrive.scoring.settings import PanelWeights

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

#: Factors that violations, faults and failures lower, in the order in which they are told; `alive` is never excused.
GATES = ("alive", "fault", "road", "direction", "red_light", "crosswalk", "stop_sign", "right_of_way", "speed")

#: What it costs not to arrive where a driver of the panel does.
NOT_ARRIVED = 0.5
#: Less progress than this share of the panel's has no score in nuPlan's form; less progress than 2 m counts as 2 m.
_PROGRESS_SHARE_MIN, _PROGRESS_UNIT = 0.2, 2.0
#: The least time that a way is worth [s]: others may always lose some of it.
_WAY_TIME_MIN = 1.0


@dataclass(frozen=True)
class Facts:
    """What decides the score of one drive. Of the panel one entry per driver; without a panel all are empty.

    Attributes:
        duration: Length of the drive [s].
        way: Distance on the reference path [m].
        free_flow: Time that the way takes in free flow [s]; nan if it has none.
        in_time: It reached its goal in time. arrived: It did, or later.
        gates: Values below 1 of `GATES`.
        ttc: 1 or 0; nan without. comfort: 1 or 0; nan without.
        lost: Time that others lose by it [vehicle seconds]; nan where no vehicle can react.
        forced: A vehicle has to brake hard for it that does not for every driver of the panel.
        panel_times: Times that the drivers take for the way [s]; inf: not that far.
        panel_arrived: Some driver arrives.
        panel_gates: As `gates`. panel_ttc: As `ttc`. panel_comfort: As `comfort`. panel_lost: As `lost`.
        panel_way: Largest distance of a driver in the same time [m]; nan without any.
    """

    duration: float
    way: float
    free_flow: float
    in_time: bool
    arrived: bool
    gates: Mapping[str, float] = field(default_factory=dict)
    ttc: float = math.nan
    comfort: float = math.nan
    lost: float = math.nan
    forced: bool = False
    panel_times: Sequence[float] = ()
    panel_arrived: bool = False
    panel_gates: Sequence[Mapping[str, float]] = ()
    panel_ttc: Sequence[float] = ()
    panel_comfort: Sequence[float] = ()
    panel_lost: Sequence[float] = ()
    panel_way: float = math.nan


@dataclass(frozen=True)
class Total:
    """The score and what it is made of, from 0 to 1.

    Attributes:
        score: Product of the gates, arrival, pace and quality.
        gates: All of `GATES` by name, after excuses. gate: Their product.
        arrival: 1, or 1/2. pace: Time of the yardstick as a share of the own time.
        quality: Weighted mean of `ttc`, `hindrance` and `comfort`, which are nan where they are absent.
        yard: Time of the second fastest driver of the panel for the way [s]; inf if fewer than two get as far, nan
            without a panel.
        excused: Gates and terms that count as 1, as no driver of the panel does better.
        cls: In nuPlan's form. epdms: In the form of NAVSIM's EPDMS.
    """

    score: float
    gates: Mapping[str, float]
    gate: float
    arrival: float
    pace: float
    quality: float
    ttc: float
    hindrance: float
    comfort: float
    yard: float
    excused: tuple[str, ...]
    cls: float
    epdms: float


def total(facts: Facts, weights: PanelWeights | None = None) -> Total:
    """The score of the drive with these `facts`."""
    weighted = weights or PanelWeights()
    yard = yardstick(facts.panel_times)
    gates, excused = _excused_gates(facts)
    gate = math.prod(gates.values())
    arrival = 1.0 if facts.arrived or not facts.panel_arrived else NOT_ARRIVED
    pace = _pace(facts, yard)
    ttc, comfort = (
        _excused_term(name, own, panel, excused)
        for name, own, panel in (
            ("ttc", facts.ttc, facts.panel_ttc),
            ("comfort", facts.comfort, facts.panel_comfort),
        )
    )
    hindrance = _hindrance(facts, yard)
    terms = ((weighted.ttc, ttc), (weighted.hindrance, hindrance), (weighted.comfort, comfort))
    quality = _mean(terms)
    progress = _progress(facts)
    judged = math.prod(gates[name] for name in ("alive", "fault", "road", "direction"))
    known_comfort = 1.0 if math.isnan(comfort) else comfort
    known_ttc = 1.0 if math.isnan(ttc) else ttc
    speed = gates["speed"]
    is_moving = progress >= _PROGRESS_SHARE_MIN
    return Total(
        score=gate * arrival * pace * quality,
        gates=gates,
        gate=gate,
        arrival=arrival,
        pace=pace,
        quality=quality,
        ttc=ttc,
        hindrance=hindrance,
        comfort=comfort,
        yard=yard,
        excused=tuple(excused),
        cls=judged * is_moving * _mean(((5.0, progress), (5.0, known_ttc), (4.0, speed), (2.0, known_comfort))),
        epdms=judged * gates["red_light"] * _mean(((5.0, progress), (5.0, known_ttc), (2.0, known_comfort))),
    )


def yardstick(times: Sequence[float]) -> float:
    """The second smallest time, the only one if there is one; nan without any."""
    return sorted(times)[min(1, len(times) - 1)] if times else math.nan


def _pace(facts: Facts, yard: float) -> float:
    if facts.in_time or math.isnan(facts.free_flow):
        return 1.0
    if math.isnan(yard):
        return min(1.0, facts.free_flow / facts.duration)
    return 1.0 if yard >= facts.duration else min(1.0, max(yard, facts.free_flow) / facts.duration)


def _excused_gates(facts: Facts) -> tuple[dict[str, float], list[str]]:
    """All gates; what no driver of the panel does better counts as 1."""
    gates, excused = {}, []
    for name in GATES:
        own = facts.gates.get(name, 1.0)
        best = max((gate.get(name, 1.0) for gate in facts.panel_gates), default=1.0)
        is_excused = name != "alive" and own < 1.0 and best < 1.0 and own >= best
        gates[name] = 1.0 if is_excused else own
        excused += [name] * is_excused
    return gates, excused


def _excused_term(name: str, own: float, panel: Sequence[float], excused: list[str]) -> float:
    known = [value for value in panel if not math.isnan(value)]
    if own == 0.0 and known and max(known) == 0.0:
        excused.append(name)
        return 1.0
    return own


def _hindrance(facts: Facts, yard: float) -> float:
    """1 if others lose no more time than with the best of the panel; 1/2 if as much more as the way is worth."""
    if math.isnan(facts.lost):
        return math.nan
    if facts.forced:
        return 0.0
    times = (time for time in (facts.free_flow, yard) if math.isfinite(time))
    worth = max(_WAY_TIME_MIN, *times, _WAY_TIME_MIN)
    usual = min((lost for lost in facts.panel_lost if not math.isnan(lost)), default=0.0)
    return worth / (worth + max(0.0, facts.lost - usual))


def _progress(facts: Facts) -> float:
    """As nuPlan's and NAVSIM's forms have it: 1 on arrival, else against the best of the panel in the same time."""
    if facts.arrived or math.isnan(facts.panel_way):
        return 1.0
    return min(1.0, max(facts.way, _PROGRESS_UNIT) / max(facts.panel_way, _PROGRESS_UNIT))


def _mean(terms: Sequence[tuple[float, float]]) -> float:
    """Weighted mean of the values that are there; 1 without any."""
    known = [(weight, value) for weight, value in terms if not math.isnan(value)]
    whole = sum(weight for weight, _ in known)
    return sum(weight * value for weight, value in known) / whole if whole > 0.0 else 1.0
