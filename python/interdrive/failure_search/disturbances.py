"""What a search changes of a scenario: starts, speeds and drivers, an error of one vehicle, the senses of the agent."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

#: What the agent's errors of perception are called, by the setting of its view.
_PERCEPTION = {
    "delay": "perceives others {value:.2f} s late",
    "position_error": "perceives positions with errors of {value:.2f} m",
    "speed_error": "perceives speeds with errors of {share:.3g} %",
    "missed": "misses others in {share:.3g} % of the time steps",
}


@dataclass(frozen=True)
class Pair:
    """An agent of a scenario file, with the vehicles that come near to it in the recording, nearest first."""

    path: str
    scenario: str
    agent_id: int
    others: tuple[int, ...]


@dataclass(frozen=True)
class Error:
    """What one other vehicle does wrong.

    Attributes:
        kind: A key of `ERRORS`.
        who: The vehicle.
        time: From its first state on [s].
        size: Braking [m/s²], or sideways offset, positive to the left [m].
        duration: Of the braking, or for how long it does not look [s].
    """

    kind: str
    who: int
    time: float
    size: float
    duration: float


@dataclass(frozen=True)
class Disturbance:
    """A point of the space in the terms of the field.

    Attributes:
        times: By vehicle, how much further along its recording it starts [s].
        speeds: By vehicle, the factor of its speeds.
        error: The error of one of them; None: there is none.
        sight: Radius within which the agent sees [m]; None: as its settings say.
        occluded: The agent does not see through vehicles and buildings.
        drivers: By vehicle, settings of its planner that its driver has drawn; others are undisturbed.
        rare: A vehicle whose driver is not among 99 % of the population; None: there is none.
        loss: Share of messages that are lost; None: as the settings say.
        perception: Settings of the agent's view that make it perceive others with errors; empty: it has none.
    """

    times: dict[int, float]
    speeds: dict[int, float]
    error: Error | None
    sight: float | None
    occluded: bool = False
    drivers: dict[int, dict[str, float]] = field(default_factory=dict)
    rare: int | None = None
    loss: float | None = None
    perception: dict[str, float] = field(default_factory=dict)

    def words(self) -> str:
        """What is different, in one line."""
        said = [
            f"{who} starts {abs(time):.2f} s {'further on' if time > 0.0 else 'earlier on its way'}"
            for who, time in self.times.items()
            if time != 0.0
        ]
        said += [f"{who} drives at {factor:.3f} of its speed" for who, factor in self.speeds.items() if factor != 1.0]
        said += [
            f"{who} is driven with {', '.join(f'{name} {value:.2f}' for name, value in own.items())}"
            for who, own in self.drivers.items()
        ]
        if self.error is not None:
            error = self.error
            what = {
                "brakes": f"brakes with {error.size:.1f} m/s² for {error.duration:.1f} s, {error.time:.1f} s after "
                "its start",
                "drifts": f"drifts {abs(error.size):.2f} m to the {'left' if error.size > 0.0 else 'right'}, "
                f"{error.time:.1f} s after its start",
                "inattentive": f"does not look for {error.duration:.1f} s, {error.time:.1f} s after its start",
                "disobeys": "keeps no rules of the road",
                "replays": "does not react",
            }
            said.append(f"{error.who} {what[error.kind]}")
        if self.sight is not None:
            said.append(f"the agent sees {self.sight:.0f} m far")
        if self.occluded:
            said.append("the agent does not see through vehicles and buildings")
        if self.loss is not None:
            said.append(f"{100.0 * self.loss:.0f} % of messages are lost")
        said += [
            f"the agent {_PERCEPTION[name].format(value=value, share=100.0 * value)}"
            for name, value in self.perception.items()
            if name in _PERCEPTION
        ]
        return "; ".join(said) or "nothing is disturbed"


#: What `Disturbance.words` say of who errs.
_ERRS = re.compile(r"(?:^|; )(-?\d+) (?:brakes|drifts|does not look|does not react|keeps no rules)")


def erring_in(words: str) -> int | None:
    """The vehicle that errs, by the words of a disturbance; None: nobody does."""
    found = _ERRS.search(words)
    return int(found[1]) if found else None
