"""Calibration: parameters and baseline of a healthy unit from its own recordings."""

from emaphm.calibration.calibrate import calibrate
from emaphm.calibration.campaign import CampaignRow
from emaphm.calibration.campaign_file import is_campaign, read_campaign
from emaphm.calibration.result import Calibration

__all__ = ["Calibration", "CampaignRow", "calibrate", "is_campaign", "read_campaign"]
