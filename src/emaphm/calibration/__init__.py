"""A healthy unit's parameters and its baseline, from its own recordings."""

from emaphm.calibration.calibrate import calibrate
from emaphm.calibration.campaign import CampaignRow
from emaphm.calibration.result import Calibration

__all__ = ["Calibration", "CampaignRow", "calibrate"]
