"""Estimators trained on an actuator's own simulations: milliseconds in place of a search."""

from emaphm.amortized.diagnosing import answer_alone, diagnose_by
from emaphm.amortized.estimator import Estimator
from emaphm.amortized.recording_setup import RecordingSetup
from emaphm.amortized.train import train_estimator

__all__ = ["Estimator", "RecordingSetup", "answer_alone", "diagnose_by", "train_estimator"]
