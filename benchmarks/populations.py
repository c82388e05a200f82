"""Writes the populations `calm` and `brisk`: quantiles of `calibrated`. `--check` compares them with what is committed.

Their medians are where 15 of 100 `calibrated` drivers are calmer, or brisker, in one number alone. Their spreads are
half of those of `calibrated`, so that the two hardly overlap; what all of its drivers have in common they have, too.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from statistics import NormalDist

from interdrive.calibration.result import drivers_file
from interdrive.config import drivers as populations
from interdrive.config.drivers import Drivers, read_drivers

FOLDER = Path(populations.__file__).parent / "populations"
#: The population, the share of its drivers beyond the medians, and how much of its spread is left.
SOURCE, QUANTILE, SPREAD = "calibrated", 0.15, 0.5
#: Where a calm driver is in a parameter: above the median, or below it.
CALM = {
    "time_gap": 1.0,
    "minimum_gap": 1.0,
    "acceleration": -1.0,
    "deceleration": -1.0,
    "politeness": 1.0,
    "changing_threshold": 1.0,
    "desired_factor": -1.0,
    "free_weight": -1.0,
}
#: What of its provenance is theirs, too.
KEPT = ("places", "held_out", "recordings", "licence", "version")


def population(name: str, side: float) -> Drivers:
    """The drivers on one side of `SOURCE`.

    Args:
        name: Of the population.
        side: 1: the calm one; -1: the other.
    """
    source = read_drivers(SOURCE)
    z = NormalDist().inv_cdf(1.0 - QUANTILE)
    parameters = {
        key: replace(one, median=float(f"{one.at(side * CALM[key] * z):.4g}"), sd=float(f"{one.sd * SPREAD:.4g}"))
        for key, one in source.parameters.items()
    }
    return replace(source, name=name, parameters=parameters)


def text(name: str, side: float) -> str:
    """The file of a population."""
    found = population(name, side)
    own = {key: found.provenance[key] for key in KEPT if key in found.provenance}
    words = f"by benchmarks/populations.py: medians at the quantile {QUANTILE:g} of {SOURCE}, {SPREAD:g} of its spread"
    return drivers_file(found, found.planner, {**own, "chosen": words})


def main() -> int:
    """Writes or checks both files."""
    for name, side in (("calm", 1.0), ("brisk", -1.0)):
        path, made = FOLDER / f"{name}.toml", text(name, side)
        if "--check" not in sys.argv[1:]:
            path.write_text(made, encoding="utf-8")
        elif path.read_text(encoding="utf-8") != made:
            sys.stdout.write(f"{path.name} is not what benchmarks/populations.py makes of {SOURCE}; run it\n")
            return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
