"""The rules of the road whose violations are recorded: the one list that tables, batches and reports are made from."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Mapping


class Rule(NamedTuple):
    """A rule of the road.

    Attributes:
        value: What the value of a violation is, with its unit.
        words: What the participant does, with `value` and `partner` to be filled in.
    """

    value: str
    words: str


_GAP = "\N{NO-BREAK SPACE}"

#: Rules by their names.
RULES: Mapping[str, Rule] = {
    "speeding": Rule("largest excess of the speed limit [m/s]", f"is {{value:.1f}}{_GAP}m/s too fast"),
    "red_light": Rule(
        "time since the light turned red [s]", f"passes a light that has been red for {{value:.1f}}{_GAP}s"
    ),
    "stop_sign": Rule("least speed before the line [m/s]", f"passes a stop sign at {{value:.1f}}{_GAP}m/s or more"),
    "right_of_way": Rule(
        "time between its rear leaving the common area and the other one's front reaching it, 0 for none [s]",
        f"takes the right of way of {{partner}}, {{value:.1f}}{_GAP}s ahead of it",
    ),
    "keep_clear": Rule("time for which it stands there [s]", f"blocks a junction for {{value:.1f}}{_GAP}s"),
    "crosswalk": Rule(
        "least distance from the person while it passes [m]",
        f"does not give way to {{partner}} on a crosswalk and passes {{value:.1f}}{_GAP}m away",
    ),
    "wrong_way": Rule("distance driven the wrong way [m]", f"drives {{value:.0f}}{_GAP}m the wrong way"),
    "solid_line": Rule("distance driven across the line [m]", f"drives {{value:.0f}}{_GAP}m across a solid line"),
}

#: Names of the rules, in the order of tables.
VIOLATIONS = tuple(RULES)
