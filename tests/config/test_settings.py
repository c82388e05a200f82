"""Dotted names onto nested dataclasses."""

from __future__ import annotations

import enum
import json
from dataclasses import dataclass, field
from typing import Annotated, Literal

import pytest

from interdrive.config.binding import bind, described, dotted, flatten
from interdrive.config.schema import SimulationSettings
from interdrive.errors import InputError


class Mode(enum.Enum):
    FAST = "f"
    EXACT = "e"


@dataclass(frozen=True)
class Frenet:
    """Settings of the planner.

    Attributes:
        horizon: How far it plans. speed_max: Never
            faster.
        levels: Sampling levels.
        offsets: Range of lateral offsets.
        mode: How to search.
        effort: How hard.
    """

    horizon: Annotated[float, "s"] = 3.0
    speed_max: Annotated[float | None, "m/s"] = None
    levels: tuple[int, ...] = (1, 2)
    offsets: Annotated[tuple[float, float], "m"] = (-3.0, 3.0)
    mode: Mode = Mode.FAST
    effort: Literal["low", "high"] = "low"

    def __post_init__(self) -> None:
        if self.horizon <= 0:
            raise InputError(f"horizon must be positive, not {self.horizon}")


@dataclass(frozen=True)
class Planner:
    frenet: Frenet = field(default_factory=Frenet)


@dataclass(frozen=True)
class Agents:
    count: int = 3
    parked: bool = False
    label: str = ""


@dataclass(frozen=True)
class Everything:
    planner: Planner = field(default_factory=Planner)
    agents: Agents = field(default_factory=Agents)


@pytest.mark.parametrize(
    ("name", "given", "expected"),
    [
        ("planner.frenet.horizon", "2.5", 2.5),
        ("planner.frenet.horizon", 2, 2.0),
        ("planner.frenet.horizon", "inf", float("inf")),
        ("planner.frenet.speed_max", "20", 20.0),
        ("planner.frenet.speed_max", "none", None),
        ("planner.frenet.levels", "1, 2,3", (1, 2, 3)),
        ("planner.frenet.levels", "4", (4,)),
        ("planner.frenet.levels", "[]", ()),
        ("planner.frenet.levels", [5, 6], (5, 6)),
        ("planner.frenet.offsets", [-1, 1.5], (-1.0, 1.5)),
        ("planner.frenet.mode", "exact", Mode.EXACT),
        ("planner.frenet.effort", "high", "high"),
        ("agents.count", "7", 7),
        ("agents.parked", "true", True),
        ("agents.parked", False, False),
        ("agents.label", "12", "12"),
    ],
)
def test_a_value_arrives_with_the_type_of_its_field(name, given, expected):
    bound = bind(Everything(), {name: given})
    owner = bound
    for part in name.split("."):
        owner = getattr(owner, part)
    assert owner == expected
    assert type(owner) is type(expected)


@pytest.mark.parametrize(
    ("name", "given", "message"),
    [
        ("planner.frenet.horizon", "long", "planner.frenet.horizon: expected a number [s], not 'long'"),
        ("planner.frenet.horizon", True, "planner.frenet.horizon: expected a number [s] (how far it plans), not True"),
        ("planner.frenet.horizon", "nan", "planner.frenet.horizon: expected a number [s], not 'nan'"),
        ("planner.frenet.horizon", "-1", "planner.frenet: horizon must be positive, not -1.0"),
        ("planner.frenet.speed_max", "fast", "planner.frenet.speed_max: expected a number or none [m/s], not 'fast'"),
        ("planner.frenet.levels", "1,x", "planner.frenet.levels: expected a list, each item a whole number, not '1,x'"),
        (
            "planner.frenet.offsets",
            "1",
            "planner.frenet.offsets: expected a list of 2 items (a number, a number) [m], not '1'",
        ),
        ("planner.frenet.mode", "slow", "planner.frenet.mode: expected one of fast, exact, not 'slow'"),
        ("planner.frenet.effort", "max", "planner.frenet.effort: expected one of low, high, not 'max'"),
        ("agents.count", "3.0", "agents.count: expected a whole number, not '3.0'"),
        ("agents.count", 3.0, "agents.count: expected a whole number, not 3.0"),
        ("agents.parked", "maybe", "agents.parked: expected true or false, not 'maybe'"),
        ("agents.parked", 1, "agents.parked: expected true or false, not 1"),
        ("agents.label", 12, "agents.label: expected a text, not 12"),
        (
            "planner.frenet.horizn",
            "1",
            "planner.frenet.horizn: no such setting; did you mean planner.frenet.horizon?",
        ),
        ("horizon", "1", "horizon: no such setting; did you mean planner.frenet.horizon?"),
        ("frenet.horizn", "1", "frenet.horizn: no such setting; did you mean planner.frenet.horizon?"),
        ("qqq", "1", "qqq: no such setting"),
        ("agents", "1", "agents: this is a group of settings, name one of agents.count, agents.parked, agents.label"),
    ],
)
def test_a_value_that_does_not_fit_is_refused_in_one_line_that_names_it(name, given, message):
    with pytest.raises(InputError) as refused:
        bind(Everything(), {name: given})
    assert str(refused.value) == message


def test_a_number_of_candidates_that_is_none_says_what_it_counts():
    wanted = "a whole number (number of sampled candidates to keep per plan), not 'true'"
    with pytest.raises(InputError) as refused:
        bind(SimulationSettings(), {"record.candidates": "true"})
    assert str(refused.value) == f"record.candidates: expected {wanted}"


def test_what_is_not_named_keeps_its_value_and_the_defaults_are_untouched():
    defaults = Everything(agents=Agents(count=9))
    bound = bind(defaults, {"planner.frenet.horizon": 1.0})
    assert bound.agents is defaults.agents
    assert defaults == Everything(agents=Agents(count=9))


def test_flattened_settings_survive_json_and_bind_back():
    changed = Everything(Planner(Frenet(2.0, 30.0, (4,), (-1.0, 1.0), Mode.EXACT, "high")), Agents(1, True, "x"))
    written = json.loads(json.dumps(flatten(changed)))
    assert written["planner.frenet.levels"] == [4]
    assert bind(Everything(), written) == changed


def test_tables_of_a_toml_file_become_dotted_names():
    assert dotted({"planner": {"frenet": {"horizon": 2.0}}, "seed": 1}) == {"planner.frenet.horizon": 2.0, "seed": 1}


def test_listings_show_units_from_types_and_what_the_docstrings_say():
    found = {name: (unit, text) for name, _, unit, text in described(Everything())}
    assert found["planner.frenet.horizon"] == ("s", "How far it plans.")
    assert found["planner.frenet.speed_max"] == ("m/s", "Never faster.")
    assert found["planner.frenet.effort"] == ("", "How hard.")
    assert found["agents.count"] == ("", "")


def test_a_name_within_a_sentence_does_not_begin_its_meaning():
    @dataclass
    class Driver:
        """A driver.

        Attributes:
            noise: A random part of the acceleration: how much it wavers. speed: Never faster.
            acceleration: how it starts.
        """

        noise: float = 0.0
        speed: float = 1.0
        acceleration: float = 2.0

    assert [text for *_, text in described(Driver())] == [
        "A random part of the acceleration: how much it wavers.",
        "Never faster.",
        "how it starts.",
    ]
