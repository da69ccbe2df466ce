"""Content of an estimator: its networks, the recordings that it is for, and the limits of its use."""

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
    """Limits beyond which an answer is not accepted; most held-out draws are within them.

    `distances` (2,) limit `Projection.distances`, `ratios` (channels,) limit the residuals of the averaged
    model, `predicted_error` limits the output of `ErrorPredictor`. See
    `emaphm.amortized.applicability.likeness`.
    """

    distances: Array
    ratios: Array
    predicted_error: float


@dataclass(frozen=True, eq=False)
class EstimatorContent:
    """The content of a file that `emaphm train` writes.

    `network` answers from the rows alone; `update` improves its answers with the averaged model.
    `temperature` (d,) multiplies the standard deviations. `error_predictor` predicts the error of an answer.
    Beyond `limits` an answer is not accepted. `facts` describe the training for the user; nothing is computed
    from them. `setup` holds the actuator, the manoeuvre and the channels.
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
        """The digest of the actuator that the estimator was trained for, see `actuator_hash`."""
        return actuator_hash(self.setup.actuator)
