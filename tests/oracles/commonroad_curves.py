"""CommonRoad's curvilinear coordinates (commonroad-clcs) as a black box."""

from __future__ import annotations

import sys
import types

import numpy as np


def curvilinear(path: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Arc length and offset [m] of points beside a path, shape (points, 2); nan outside the projection domain.

    Paths that turn by more than 90 degrees at a vertex are refused there: all nan.
    """
    # Needed for smoothing paths only, which is not done here.
    sys.modules.setdefault("osqp", types.ModuleType("osqp"))
    from commonroad_clcs.clcs import CurvilinearCoordinateSystem
    from commonroad_clcs.config import CLCSParams
    from commonroad_clcs.pycrccosy import CartesianProjectionDomainError

    found = np.full((len(points), 2), np.nan)
    try:
        system = CurvilinearCoordinateSystem(path, CLCSParams(), preprocess_path=False)
    except AssertionError:
        return found
    for i, (x, y) in enumerate(points.tolist()):
        try:
            found[i] = system.convert_to_curvilinear_coords(x, y)
        except (ValueError, CartesianProjectionDomainError):
            continue
    return found
