"""An estimator: a network, trained on an actuator's own simulations, that names a recording's faults."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, Self

from emaphm.actuator import Actuator
from emaphm.amortized.applicability.refusals import check_actuator, check_recording
from emaphm.amortized.error_prediction.comparison import Comparison
from emaphm.amortized.error_prediction.predictor import ErrorPredictor
from emaphm.amortized.model_update import ModelUpdate
from emaphm.amortized.networks.mixture import Mixture
from emaphm.amortized.networks.network import Network, Single
from emaphm.amortized.networks.projection import Projection
from emaphm.amortized.recording_setup import RecordingSetup, actuator_hash, rows_of
from emaphm.amortized.simulating import block_of, in_blocks
from emaphm.arrays import Array
from emaphm.blas_threads import one_blas_thread
from emaphm.estimation.space.parameter_space import ParameterSpace
from emaphm.recording import Recording
from emaphm.simulation import Inputs


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
class Estimator:
    """What a file of `emaphm train` holds.

    `network` answers from rows alone, read through `projection`; `update` improves its answers by the
    averaged model. `temperature` (d,) multiplies the standard deviations; `error_predictor` predicts the
    error of an answer, and `limits` say when none is believed. `facts` are those of its training, for people
    to read. All else is in the setup.
    """

    setup: RecordingSetup
    projection: Projection
    network: Network
    update: ModelUpdate
    temperature: Array
    error_predictor: ErrorPredictor
    limits: Limits
    facts: Mapping[str, Any] = field(default_factory=dict)

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Return the estimator in a file that `emaphm train` wrote.

        Raises
        ------
        MethodError
            The file is absent, too large, damaged, of another version, or no estimator.
        """
        from emaphm.amortized.estimator_file import read_estimator

        found: Self = read_estimator(Path(path), cls)
        return found

    def save(self, path: str | Path) -> None:
        """Write one file, as a whole; `OutputError` where it cannot be written."""
        from emaphm.amortized.estimator_file import write_estimator

        write_estimator(self, path)

    @cached_property
    def space(self) -> ParameterSpace:
        """The coordinates of the answers."""
        return self.setup.space

    @cached_property
    def actuator_hash(self) -> str:
        """What identifies the actuator that it was trained for."""
        return actuator_hash(self.setup.actuator)

    def check_actuator(self, actuator: Actuator) -> None:
        """Refuse another description than the one that it was trained for, `MethodError`."""
        check_actuator(self.setup, actuator)

    def check(self, recording: Recording, actuator: Actuator) -> None:
        """Refuse a recording that the estimator cannot be asked about; `MethodError` gives the way out."""
        check_actuator(self.setup, actuator)
        check_recording(self.setup, recording)

    def rows(self, recording: Recording) -> Single:
        """Return what the network reads of a recording that `check` has accepted, (1, channels, blocks)."""
        return in_blocks(rows_of(recording, self.setup.channels), block_of(self.setup.samples))

    @one_blas_thread()
    def answers(self, rows: Single, inputs: Inputs) -> list[Mixture]:
        """Return what is known of each of n recordings, all driven by `inputs`; one mixture each.

        `rows` is (n, channels, blocks), in the channels' units: several of `Estimator.rows`, end to end.
        """
        return calibrated_answers(self.setup, self.network, self.update, self.temperature, rows, inputs)

    def distances(self, rows: Single) -> Array:
        """Return how unlike the training set rows (n, channels, blocks) are, (n, 2)."""
        return self.projection.distances(rows, self.network.features(rows))

    def predicted_errors(self, comparison: Comparison) -> Array:
        """Return the predicted error of each of the answers, relative to the allowed one, (n,)."""
        distances = self.distances(comparison.rows)
        return self.error_predictor.predicted(
            comparison.features(self.setup, self.update.whitening, distances)
        )


def first_answers(network: Network, rows: Single) -> list[Mixture]:
    """Return what a network makes of rows (n, channels, blocks)."""
    return network.mixtures(network.features(rows))


def calibrated_answers(
    setup: RecordingSetup,
    network: Network,
    update: ModelUpdate,
    temperature: Array,
    rows: Single,
    inputs: Inputs,
) -> list[Mixture]:
    """Return what both networks make of rows (n, channels, blocks), as sure as `temperature` (d,) allows."""
    updated = update.answers(setup, inputs, rows, first_answers(network, rows))
    return [one.scaled(temperature) for one in updated]
