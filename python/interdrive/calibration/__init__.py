"""Populations of drivers that are fitted to recordings."""

from interdrive.calibration.fit import calibrate
from interdrive.calibration.result import Calibration

__all__ = ["Calibration", "calibrate"]
