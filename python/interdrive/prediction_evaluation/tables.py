"""The evaluation and its tables: measures, samples; `curves` has calibration and error."""

from __future__ import annotations

from dataclasses import dataclass, field
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.config.schema import SimulationSettings
from interdrive.prediction_evaluation.measures import HORIZONS, MISS
from interdrive.prediction_evaluation.recordings import CATEGORIES
from interdrive.prediction_evaluation.split import TRAFFIC, UNKNOWN
from interdrive.scenario import KINDS
from interdrive.storage import Column, arrow_table, labels
from interdrive.storage.html import html_table

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from numpy.typing import NDArray

    from interdrive.array_types import Bools, Floats
    from interdrive.config.specs import Resolved
    from interdrive.prediction_evaluation.samples import Samples
    from interdrive.run import Json
    from interdrive.storage import ArrowTable

#: Names of the two rows for everything: every sample weighs the same, or every category of `CATEGORIES` does.
ALL, MEAN = "all samples", "mean of categories"
#: Traffic of the rows that are about all of it.
ANY = "all"
#: Probability masses of the regions in the table of measures.
MASSES = (50, 90, 99)

_OF_MODE = {"": "of the most probable mode", "_best": "of the best mode"}


def _measure_columns() -> tuple[Column, ...]:
    def number(name: str, text: str, unit: str = "1") -> Column:
        return Column(name, "number", text, unit, null="no sample")

    columns = [
        Column("predictor", "label", "name, with its settings"),
        Column("category", "label", "of the files; or all samples, or the mean of the categories"),
        Column("traffic", "label", "recorded, simulated, invented or unknown; or all"),
        Column("files", "integer", "files with samples"),
        Column("vehicles", "integer", "vehicles with samples"),
        Column("samples", "integer", "vehicles at time steps"),
    ]
    for h in HORIZONS:
        columns += [
            Column(f"samples_{h}", "integer", f"samples whose recording goes on for {h} s"),
            number(f"answered_{h}", f"share of them with a prediction for {h} s"),
        ]
    for best, text in _OF_MODE.items():
        for h in HORIZONS:
            columns += [
                number(f"ade{best}_{h}", f"mean distance over {h} s {text}", "m"),
                number(f"fde{best}_{h}", f"distance after {h} s {text}", "m"),
            ]
        columns.append(number(f"miss_rate{best}", f"share with a distance over {MISS:g} m after 3 s {text}"))
    for h in HORIZONS:
        columns += [
            number(f"nll_{h}", f"negative log-likelihood of the position after {h} s, mean", "nats"),
            number(f"nll_median_{h}", "the same, median", "nats"),
        ]
    columns.append(number("nll", "negative log-likelihood, mean over all steps until 3 s", "nats"))
    for name, text in (
        ("region", "region of highest density of the mixture"),
        ("ellipse", "most probable mode's ellipse"),
    ):
        columns += [
            number(f"{name}_{mass}_{h}", f"share of positions after {h} s inside the {mass} % {text}")
            for h in HORIZONS
            for mass in MASSES
        ]
    columns += [
        number(f"moving_{mass}_{h}", f"the same as region_{mass}_{h}, without vehicles that stand and stay")
        for h in HORIZONS
        for mass in MASSES
    ]
    for name, text in (("stays", "vehicles that stand and stay"), ("stands", "vehicles that stand now")):
        columns += [
            Column(f"{name}_samples", "integer", f"samples of {text}"),
            number(f"{name}_median", f"displacement predicted for 3 s for {text}, median", "m"),
            number(f"{name}_p95", f"displacement predicted for 3 s for {text}, 95th percentile", "m"),
        ]
    columns.append(number("off_road", "probability predicted for being off the road, of vehicles that are on it"))
    return tuple(columns)


MEASURE_COLUMNS = _measure_columns()

#: Columns that a notebook shows.
_SHOWN = ("predictor", "category", "traffic", "samples", "ade_3", "fde_3", "fde_best_3", "miss_rate", "nll")

_SAMPLE_VALUES = (
    *(f"{name}_{h}" for h in HORIZONS for name in ("ade", "fde", "ade_best", "fde_best", "nll", "region", "ellipse")),
    "nll",
    "displacement",
)

SAMPLE_COLUMNS = (
    Column("predictor", "label", "its name"),
    Column("file", "label", "name of the file"),
    Column("category", "label", "of the file"),
    Column("traffic", "label", "recorded, simulated, invented or unknown"),
    Column("time_step", "integer", "when"),
    Column("participant_id", "integer", "predicted participant"),
    Column("kind", "label", "car, truck, ..."),
    Column("speed", "number", "along the heading", "m/s"),
    Column("known", "number", "recorded time", "s"),
    Column("stands", "truth", "known for 0.5 s and moved less than 0.1 m in it"),
    Column("stays", "truth", "stands, and moves less than 0.1 m in the next 3 s"),
    Column("departure", "number", "distance after 3 s from a drive with the present velocity", "m", null="no sample"),
    *(
        Column(
            name,
            "number",
            "see interdrive.prediction_evaluation.measures.judged",
            "m" if name.startswith(("ade", "fde", "displacement")) else "nat" if name.startswith("nll") else "1",
            null="no sample",
        )
        for name in _SAMPLE_VALUES
    ),
)


@dataclass(frozen=True)
class PredictionEvaluation:
    """The result of `evaluate_predictors`.

    Attributes:
        files: The files with samples, in order.
        predictors: Names, in order.
        samples: Every sample.
        notes: What was left out, and why.
        settings: The arguments, as plain values.
        choices: The predictors, to evaluate them again.
        simulation: Settings of predictors, road and steps.
    """

    files: tuple[Path, ...]
    predictors: tuple[str, ...]
    samples: Samples
    notes: tuple[str, ...] = ()
    settings: Mapping[str, Json] = field(default_factory=dict)
    choices: tuple[Resolved, ...] = ()
    simulation: SimulationSettings = field(default_factory=SimulationSettings)

    def __repr__(self) -> str:
        return f"<PredictionEvaluation of {', '.join(self.predictors)} on {len(self.files)} files>"

    @property
    def table(self) -> ArrowTable:
        """The measures, as `measures_table` has them."""
        return measures_table(self)

    def _repr_html_(self) -> str:
        """The line of `repr` and the most important measures, for notebooks."""
        return f"<p>{escape(repr(self))}</p>{html_table(_SHOWN, self.table.to_pylist())}"


def groups(samples: Samples) -> dict[tuple[str, str], Any]:
    """(category, traffic) -> mask of its samples.

    First come all traffic (`ANY`) and then, unless it is all unknown, every kind of it that is there; of each its
    categories, those of `CATEGORIES` first, the others by name, then `ALL`.
    """
    kinds = [name for name in TRAFFIC if (samples.traffic == name).any()]
    found = {}
    for traffic in (ANY, *(kinds if kinds != [UNKNOWN] else [])):
        of_traffic = np.ones(len(samples), dtype=np.bool_) if traffic == ANY else samples.traffic == traffic
        there = set(samples.category[of_traffic].tolist())
        for name in sorted(there, key=lambda name: (name not in CATEGORIES, _place(name), name)):
            found[name, traffic] = of_traffic & (samples.category == name)
        found[ALL, traffic] = of_traffic
    return found


def _place(name: str) -> int:
    return CATEGORIES.index(name) if name in CATEGORIES else len(CATEGORIES)


def measures_table(found: PredictionEvaluation) -> ArrowTable:
    """One row per predictor, traffic and category, then one for all samples and one for the mean of the categories.

    That mean is taken over those of `CATEGORIES` that are there, over all others if none is; its numbers of samples are
    those of the categories it is about.
    """
    rows = []
    masks = groups(found.samples)
    for predictor in found.predictors:
        for traffic in dict.fromkeys(traffic for _, traffic in masks):
            by_category = {
                category: _summed(found.samples, mask, found.samples.values[predictor])
                for (category, of_traffic), mask in masks.items()
                if of_traffic == traffic
            }
            whole = by_category.pop(ALL)
            counted = {name: row for name, row in by_category.items() if name in CATEGORIES} or by_category
            for name, row in (*by_category.items(), (ALL, whole), (MEAN, _mean(list(counted.values())))):
                rows.append({"predictor": predictor, "category": name, "traffic": traffic, **row})
    return table_of(MEASURE_COLUMNS, rows)


def _summed(samples: Samples, mask: Bools, values: dict[str, Any]) -> dict[str, Any]:
    def mean(name: str) -> float:
        return mean_of(values[name][mask])

    row: dict[str, Any] = {
        "files": len(np.unique(samples.file[mask])),
        "vehicles": len(np.unique(np.stack([samples.file[mask], samples.participant_id[mask]]), axis=1).T),
        "samples": int(mask.sum()),
        "nll": mean("nll"),
        "off_road": mean("off_road"),
    }
    for h in HORIZONS:
        row[f"samples_{h}"] = int(np.isfinite(values[f"answered_{h}"][mask]).sum())
        row[f"nll_median_{h}"] = _quantile(values[f"nll_{h}"][mask], 0.5)
        for name in ("answered", "ade", "fde", "ade_best", "fde_best", "nll"):
            row[f"{name}_{h}"] = mean(f"{name}_{h}")
        for name, measure, part in (
            ("region", "region", mask),
            ("ellipse", "ellipse", mask),
            ("moving", "region", mask & ~samples.stays),
        ):
            for mass in MASSES:
                row[f"{name}_{mass}_{h}"] = share_of(values[f"{measure}_{h}"][part], mass)
    for best in _OF_MODE:
        ends = values[f"fde{best}_{HORIZONS[-1]}"][mask]
        row[f"miss_rate{best}"] = mean_of(np.where(np.isfinite(ends), ends > MISS, np.nan))
    for name in ("stays", "stands"):
        moved = values["displacement"][mask & getattr(samples, name)]
        row |= {
            f"{name}_samples": int(np.isfinite(moved).sum()),
            f"{name}_median": _quantile(moved, 0.5),
            f"{name}_p95": _quantile(moved, 0.95),
        }
    return row


def _mean(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Counts added, everything else as the mean over the rows that have it."""
    counts = {column.name for column in MEASURE_COLUMNS if column.kind == "integer"}
    return {
        name: sum(row[name] for row in rows) if name in counts else mean_of(np.array([row[name] for row in rows]))
        for name in rows[0]
    }


def mean_of(values: NDArray[Any]) -> float:
    """Mean of the values that are numbers; nan if none is."""
    known = values[np.isfinite(values)] if values.dtype != np.bool_ else values
    return float(known.mean()) if known.size else float("nan")


def _quantile(values: Floats, share: float) -> float:
    known = values[np.isfinite(values)]
    return float(np.quantile(known, share)) if known.size else float("nan")


def share_of(levels: Floats, percent: float) -> float:
    """Share of the known levels up to a percentage; nan if none is known."""
    known = levels[np.isfinite(levels)]
    return float((known <= percent / 100.0).mean()) if known.size else float("nan")


def samples_table(found: PredictionEvaluation) -> ArrowTable:
    """Every sample and predictor, one row each."""
    samples, n = found.samples, len(found.predictors)

    def tiled(values: Any) -> Any:  # noqa: ANN401 - array
        return np.tile(values, n)

    def label(values: Any) -> Any:  # noqa: ANN401 - array
        names, place = np.unique(values.astype(str), return_inverse=True)
        return labels(tuple(names.tolist()), tiled(place))

    columns = {
        "predictor": labels(found.predictors, np.repeat(np.arange(n), len(samples))),
        "file": labels(tuple(path.name for path in found.files), tiled(samples.file)),
        "category": label(samples.category),
        "traffic": label(samples.traffic),
        "kind": labels(KINDS, tiled(samples.kind)),
    }
    for name in ("time_step", "participant_id", "speed", "known", "stands", "stays", "departure"):
        columns[name] = tiled(getattr(samples, name))
    for name in _SAMPLE_VALUES:
        columns[name] = np.concatenate([samples.values[predictor][name] for predictor in found.predictors])
    return arrow_table(SAMPLE_COLUMNS, columns)


def table_of(columns: tuple[Column, ...], rows: list[dict[str, Any]]) -> ArrowTable:
    """A table from rows of plain values."""
    return arrow_table(columns, {column.name: [row[column.name] for row in rows] for column in columns})
