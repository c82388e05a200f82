"""Curves of an evaluation as Arrow tables: calibration over nominal shares, error over time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from interdrive.prediction_evaluation.measures import HORIZONS, TIMES
from interdrive.prediction_evaluation.tables import groups, mean_of, share_of, table_of
from interdrive.storage import Column

if TYPE_CHECKING:
    from interdrive.array_types import Bools
    from interdrive.prediction_evaluation.samples import Samples
    from interdrive.prediction_evaluation.tables import PredictionEvaluation
    from interdrive.storage import ArrowTable

#: Nominal shares of the calibration curve [%].
NOMINAL = (5, 10, 15, 20, 25, 30, 35, 40, 45, 50, 55, 60, 65, 70, 75, 80, 85, 90, 95, 99)
#: Groups of vehicles with a calibration of their own: all; moving ones; vehicles that stand and stay for 3 s.
ALL_VEHICLES, MOVING, STAYING = "all", "moving", "staying"

CALIBRATION_COLUMNS = (
    Column("predictor", "label", "its name"),
    Column("category", "label", "of the files, or all samples"),
    Column("traffic", "label", "recorded, simulated, invented or unknown; or all"),
    Column("vehicles", "label", "all; staying: they stand and stay for 3 s; moving: all others"),
    Column("horizon", "number", "time from now", "s"),
    Column("nominal", "number", "probability mass of the region", "1"),
    Column("samples", "integer", "positions that are known and were predicted"),
    Column(
        "region", "number", "share of positions inside the mixture's region of highest density", "1", null="no sample"
    ),
    Column("ellipse", "number", "share of positions inside the most probable mode's ellipse", "1", null="no sample"),
)

ERROR_COLUMNS = (
    Column("predictor", "label", "its name"),
    Column("category", "label", "of the files, or all samples"),
    Column("traffic", "label", "recorded, simulated, invented or unknown; or all"),
    Column("time", "number", "from now", "s"),
    Column("error", "number", "mean distance of the most probable mode", "m", null="no sample"),
    Column("error_best", "number", "mean distance of the best mode", "m", null="no sample"),
)


def _by_vehicles(samples: Samples, mask: Bools) -> dict[str, Bools]:
    return {ALL_VEHICLES: mask, MOVING: mask & ~samples.stays, STAYING: mask & samples.stays}


def calibration_table(found: PredictionEvaluation) -> ArrowTable:
    """Observed shares for every nominal one of `NOMINAL`, by predictor, category, traffic, vehicles and horizon.

    Vehicles that stand and stay are in the middle of every region; together with them a spread looks wider than it is
    for moving vehicles.
    """
    rows = []
    for predictor in found.predictors:
        values = found.samples.values[predictor]
        for (category, traffic), mask in groups(found.samples).items():
            for vehicles, those in _by_vehicles(found.samples, mask).items():
                for h in HORIZONS:
                    region, ellipse = values[f"region_{h}"][those], values[f"ellipse_{h}"][those]
                    about = {
                        "predictor": predictor,
                        "category": category,
                        "traffic": traffic,
                        "vehicles": vehicles,
                        "horizon": float(h),
                        "samples": int(np.isfinite(region).sum()),
                    }
                    rows += [
                        about
                        | {
                            "nominal": nominal / 100.0,
                            "region": share_of(region, nominal),
                            "ellipse": share_of(ellipse, nominal),
                        }
                        for nominal in NOMINAL
                    ]
    return table_of(CALIBRATION_COLUMNS, rows)


def error_table(found: PredictionEvaluation) -> ArrowTable:
    """Mean distance at `TIMES`, by predictor, category and traffic."""
    rows = [
        {
            "predictor": predictor,
            "category": category,
            "traffic": traffic,
            "time": time,
            **{name: mean_of(found.samples.values[predictor][name][mask, column]) for name in ("error", "error_best")},
        }
        for predictor in found.predictors
        for (category, traffic), mask in groups(found.samples).items()
        for column, time in enumerate(TIMES)
    ]
    return table_of(ERROR_COLUMNS, rows)
