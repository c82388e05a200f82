"""Scores of planners as a table for a paper, in LaTeX and Markdown: intervals, numbers, and what is separable."""

from __future__ import annotations

import itertools
import math
import platform
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from interdrive import _core
from interdrive.comparison.intervals import (
    LEVEL,
    PLACES_MIN,
    PLACES_SURE,
    SAMPLES,
    chance,
    drawn_means,
    draws,
    holm,
    letters,
)

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from interdrive.comparison.scores import PlannerScore

#: Characters that mean something to LaTeX.
_LATEX = {
    **{character: "\\" + character for character in "&%$#_{}"},
    **{"~": r"\textasciitilde{}", "^": r"\textasciicircum{}", "\\": r"\textbackslash{}", "−": "$-$"},
    **{"<": "$<$", ">": "$>$", "²": "$^2$", "³": "$^3$"},
}


@dataclass(frozen=True)
class PaperTable:
    """A table with what is needed to repeat it.

    Attributes:
        caption: What the numbers are, of what, and made by what.
        head: Names of the columns.
        rows: Texts; the first of each is the planner.
    """

    caption: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]

    def markdown(self) -> str:
        """The table as Markdown, its caption below it."""
        lines = [self.head, ("---", *("--:" for _ in self.head[1:])), *self.rows]
        piped = ("| " + " | ".join(text.replace("|", "\\|") for text in line) + " |" for line in lines)
        return "\n".join([*piped, "", self.caption]) + "\n"

    def latex(self) -> str:
        """The table as LaTeX, which needs the package booktabs."""
        body = [r" & ".join(map(_latex, row)) + r" \\" for row in self.rows]
        return "\n".join(
            [
                r"\begin{table}",
                r"\centering",
                rf"\caption{{{_latex(self.caption)}}}",
                rf"\begin{{tabular}}{{l{'r' * (len(self.head) - 1)}}}",
                r"\toprule",
                " & ".join(map(_latex, self.head)) + r" \\",
                r"\midrule",
                *body,
                r"\bottomrule",
                r"\end{tabular}",
                r"\end{table}",
            ]
        ) + "\n"  # fmt: skip


def separable(scores: Mapping[str, Mapping[str, float]], places: Mapping[str, str]) -> dict[str, str]:
    """Letters of planners: those that share one are not separable; no letters with fewer than 10 places.

    All pairs over the files that all have, with the same draws of places, adjusted after Holm at 0.05.

    Args:
        scores: Score of each file, by planner.
        places: The place of each file.
    """
    files = sorted(set.intersection(*(set(one) for one in scores.values()))) if scores else []
    names, group = np.unique(np.array([places[file] for file in files], dtype=str), return_inverse=True)
    if len(names) < PLACES_SURE:
        return {}
    values = {name: np.array([one[file] for file in files]) for name, one in scores.items()}
    drawn = draws(len(names))
    pairs = list(itertools.combinations(scores, 2))
    chances = []
    for one, other in pairs:
        apart = values[one] - values[other]
        chances.append(chance(float(apart.mean()), drawn_means(apart, group, drawn), len(names)))
    differ = {frozenset(pair): p < 1.0 - LEVEL for pair, p in zip(pairs, holm(chances), strict=True)}
    return letters(sorted(scores, key=lambda name: -float(values[name].mean())), differ)


def paper_table(
    scores: Sequence[PlannerScore],
    places: Mapping[str, str],
    about: str,
    further: Mapping[str, Mapping[str, float]] | None = None,
) -> PaperTable:
    """Planners with their scores, the best first.

    Args:
        scores: Of planners in the same traffic.
        places: The place of each scenario, by its hash.
        about: What was driven, and the command, for the caption.
        further: More columns: a heading, and the value of each planner.
    """
    ordered = sorted(scores, key=lambda one: (math.isnan(one.score), -one.score))
    marks = separable({one.variant: one.by_scenario for one in ordered if one.by_scenario}, places)
    more = further or {}
    head = ("planner", "score", f"{100 * LEVEL:g} %", *(("separable",) if marks else ()))
    head += ("in time %", "at fault per 100", *more, "agents", "files", "places")
    rows = []
    for one in ordered:
        span = "" if math.isnan(one.low) else f"{one.low:.1f} to {one.high:.1f}"
        there = {places[name] for name in one.by_scenario}
        rows.append(
            (
                one.variant,
                _number(one.score),
                span,
                *((marks.get(one.variant, ""),) if marks else ()),
                _number(one.reached),
                _number(one.at_fault),
                *(_number(values.get(one.variant, math.nan)) for values in more.values()),
                *(str(one.n_agents), str(one.n_scenarios), str(len(there))),
            )
        )
    return PaperTable(_caption(ordered, marks, about), head, tuple(rows))


def _caption(scores: Sequence[PlannerScore], marks: Mapping[str, str], about: str) -> str:
    said = [about.rstrip(".") + ".", "Score: mean over files of the means of their agents, 0 to 100."]
    if any(not math.isnan(one.low) for one in scores):
        said.append(f"Intervals: {SAMPLES} bootstrap samples of places, widened for their number.")
    else:
        said.append(f"No intervals: there are fewer than {PLACES_MIN} places.")
    if marks:
        n_pairs = len(marks) * (len(marks) - 1) // 2
        pairs = f"all {n_pairs} pairs" if n_pairs > 1 else "one pair"
        said.append(f"Planners that share a letter are not separable ({pairs}, p adjusted after Holm, 0.05).")
    else:
        said.append(f"Nothing is claimed to be separable: that takes {PLACES_SURE} places or more.")
    panels = sorted({one.panel for one in scores})
    said.append("Absolute scores, without a panel." if panels == [""] else f"Panel: {' | '.join(panels)}.")
    said.append(f"interdrive {_core.__version__}, {platform.system()} {platform.machine()}.")
    return " ".join(said)


def _number(value: float) -> str:
    return "" if math.isnan(value) else f"{value:.1f}"


def _latex(text: str) -> str:
    return "".join(_LATEX.get(character, character) for character in text)
