"""Metrics of predictions of remaining useful life (RUL) against the time at which the unit failed.

All times are flight hours [h]; a prediction is a sample of the RUL, in which `inf` means no failure in sight.
The true RUL at hours t is failure - t.
"""

from emaphm.prognosis.metrics.horizon_and_accuracy import (
    PrognosticHorizon,
    alpha_lambda,
    at_share_of_life,
    cumulative_relative_accuracy,
    prognostic_horizon,
    relative_accuracy,
)
from emaphm.prognosis.metrics.operation import (
    false_alarms_per_1000_hours,
    late_prediction_rate,
    wasted_life,
)
from emaphm.prognosis.metrics.prediction import Prediction
from emaphm.prognosis.metrics.scores import (
    brier,
    coverage,
    crps,
    probability_integral_transform,
)

__all__ = [
    "Prediction",
    "PrognosticHorizon",
    "alpha_lambda",
    "at_share_of_life",
    "brier",
    "coverage",
    "crps",
    "cumulative_relative_accuracy",
    "false_alarms_per_1000_hours",
    "late_prediction_rate",
    "probability_integral_transform",
    "prognostic_horizon",
    "relative_accuracy",
    "wasted_life",
]
