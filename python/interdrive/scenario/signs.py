"""Signs of priority: their names and numbers in files, and what each is worth where ways meet."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

from interdrive import _core

#: What readers of other formats and pages of runs call a sign of priority.
SignKind: TypeAlias = Literal["stop", "yield", "priority"]

#: What a sign is worth for a turn to the left, straight on and to the right. The way with the greater rank goes first;
#: one without a sign has `_core.RANK_WITHOUT_SIGN`.
Ranks: TypeAlias = tuple[int, int, int]

#: All kinds; the position is the code on the page of a run.
SIGN_KINDS: tuple[SignKind, ...] = ("stop", "yield", "priority")


@dataclass(frozen=True)
class PrioritySign:
    """A sign that tells which vehicle goes first.

    Attributes:
        name: In commonroad-io.
        kind: In sources of other formats, and as it is drawn.
        ranks: What it is worth.
        numbers: In the lists of countries, each of which counts in every country. The first one is written.
    """

    name: str
    kind: SignKind
    ranks: Ranks
    numbers: tuple[str, ...]


#: All signs of priority. The first one of a kind stands for it, the first one with certain ranks is written for them.
PRIORITY_SIGNS = (
    PrioritySign("STOP", "stop", (_core.STOP_RANK,) * 3, ("206", "R1-1", "r2", "2.5")),
    PrioritySign("YIELD", "yield", (2, 2, 2), ("205", "R1-2", "r1", "2.4")),
    PrioritySign("ROUNDABOUT", "yield", (2, 2, 2), ("215",)),
    PrioritySign("PRIORITY", "priority", (4, 5, 4), ("306", "2.1")),
    PrioritySign("RIGHT_OF_WAY", "priority", (4, 5, 4), ("301",)),
)

#: Kinds by the numbers of signs.
KIND_BY_NUMBER: dict[str, SignKind] = {number: sign.kind for sign in PRIORITY_SIGNS for number in sign.numbers}

#: Name in commonroad-io and number of the sign beside which drivers may turn right on red.
GREEN_ARROW, GREEN_ARROW_NUMBER = "GREEN_ARROW", "720"


def sign_of(kind: SignKind) -> PrioritySign:
    """The sign that stands for a kind."""
    return next(sign for sign in PRIORITY_SIGNS if sign.kind == kind)


def sign_with(ranks: Ranks) -> PrioritySign | None:
    """The sign that is written and drawn for ranks; None: no sign has them."""
    return next((sign for sign in PRIORITY_SIGNS if sign.ranks == ranks), None)
