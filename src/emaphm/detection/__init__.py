"""Anomaly detection: comparison of a cycle with healthy cycles of the same manoeuvre and load."""

from emaphm.detection.detector import Detector
from emaphm.detection.left_out import LeftOut, judged_left_out
from emaphm.detection.result import DetectorResult
from emaphm.detection.settings import DETECTOR, DetectorSettings

__all__ = ["DETECTOR", "Detector", "DetectorResult", "DetectorSettings", "LeftOut", "judged_left_out"]
