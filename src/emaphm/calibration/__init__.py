"""A healthy unit's parameters and its baseline, from its own recordings."""

from emaphm.calibration.calibrate import Calibration, calibrate

__all__ = ["Calibration", "calibrate"]
