"""What an estimator consists of: what was trained, for which recordings, and when it is believed."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from emaphm.amortized.error_prediction.predictor import ErrorPredictor
from emaphm.amortized.model_update import ModelUpdate
from emaphm.amortized.networks.network import Network
from emaphm.amortized.recording_setup import RecordingSetup, actuator_hash
from emaphm.arrays import Array
from emaphm.estimation.space.parameter_space import ParameterSpace


@dataclass(frozen=True, eq=False)
class Limits:
    """What most held-out draws do not exceed, see `emaphm.amortized.applicability.likeness`.

    `distances` (2,) are those of `Projection.distances`, `ratios` (channels,) those of the comparison with
    the averaged model, `predicted_error` that of `ErrorPredictor`.
    """

    distances: Array
    ratios: Array
    predicted_error: float


@dataclass(frozen=True, eq=False)
class EstimatorContent:
    """What a file of `emaphm train` holds.

    `network` answers from rows alone; `update` improves its answers by the averaged model. `temperature` (d,)
    multiplies the standard deviations; `error_predictor` predicts the error of an answer, and `limits` say
    when none is believed. `facts` are those of its training, for people to read. All else is in the setup.
    """

    setup: RecordingSetup
    network: Network
    update: ModelUpdate
    temperature: Array
    error_predictor: ErrorPredictor
    limits: Limits
    facts: Mapping[str, Any] = field(default_factory=dict)

    @cached_property
    def space(self) -> ParameterSpace:
        """The coordinates of the answers."""
        return self.setup.space

    @cached_property
    def actuator_hash(self) -> str:
        """What identifies the actuator that it was trained for."""
        return actuator_hash(self.setup.actuator)
