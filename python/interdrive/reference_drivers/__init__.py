"""Reference drivers of UN R157 in one dimension: what each would have avoided, and safe distances of RSS.

found = interdrive.reference_drivers.cut_in("cc", velocity=30.0, other_velocity=[10.0, 20.0], gap=40.0, sideways=1.1)
found.crash                    # per case
interdrive.reference_drivers.rss.same_direction(20.0, 10.0)    # m

Definitions, sources and limits: docs/concepts/preventability.md.
"""

from interdrive.reference_drivers import rss
from interdrive.reference_drivers.cases import DRIVERS, CutOuts, Endings, car_following, cut_in, cut_out

__all__ = ["DRIVERS", "CutOuts", "Endings", "car_following", "cut_in", "cut_out", "rss"]
