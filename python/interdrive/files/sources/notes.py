"""Counts what a reader leaves out, changes or doubts, so that each kind becomes one line."""

from __future__ import annotations

from collections import Counter, defaultdict

#: So many names of lanes, roads or tracks are listed in a line.
_NAMED = 5


class Notes:
    """Remarks on a source, collected while it is read."""

    def __init__(self) -> None:
        self._left_out: dict[str, Counter[str]] = defaultdict(Counter)
        self._named: dict[str, list[str]] = {}
        self._lines: list[str] = []

    def leave_out(self, what: str, kind: str, count: int = 1) -> None:
        """Counts something that is not read: what it is, in the plural ("lanes"), and of which kind ("sidewalk")."""
        self._left_out[what][kind] += count

    def name(self, remark: str, name: object) -> None:
        """Adds a name, such as that of a road, to a remark that ends with them all ("roads without width: 1, 2")."""
        names = self._named.setdefault(remark, [])
        if str(name) not in names[-1:]:
            names.append(str(name))

    def say(self, line: str) -> None:
        """Adds a line, once."""
        if line not in self._lines:
            self._lines.append(line)

    def left_out(self, what: str) -> dict[str, int]:
        """How many of them were left out, by kind."""
        return dict(self._left_out[what])

    def lines(self) -> tuple[str, ...]:
        """All remarks, those about what was left out first."""
        counted = [f"{_counts(kinds)} {what}" for what, kinds in self._left_out.items() if kinds]
        left_out = [f"left out: {', '.join(counted)}"] if counted else []
        return (*left_out, *self._lines, *(f"{remark}: {_listed(names)}" for remark, names in self._named.items()))


def _counts(kinds: Counter[str]) -> str:
    ordered = sorted(kinds.items(), key=lambda item: (-item[1], item[0]))
    return ", ".join(f"{count} {kind}".strip() for kind, count in ordered)


def _listed(names: list[str]) -> str:
    shown = ", ".join(names[:_NAMED])
    return shown if len(names) <= _NAMED else f"{shown} and {len(names) - _NAMED} more"
