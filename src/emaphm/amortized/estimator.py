"""The estimator: networks trained on simulations of one actuator, which infer the faults of a recording."""

from dataclasses import dataclass
from pathlib import Path
from typing import Self

from emaphm.actuator import Actuator
from emaphm.amortized.applicability.refusals import check_recording, check_trained_for
from emaphm.amortized.content import EstimatorContent
from emaphm.amortized.error_prediction.comparison import Comparison
from emaphm.amortized.model_update import ModelUpdate
from emaphm.amortized.networks.mixture import Mixture
from emaphm.amortized.networks.network import Network
from emaphm.amortized.recording_setup import RecordingSetup, rows_of
from emaphm.amortized.simulating import block_of, in_blocks
from emaphm.amortized.storage.estimator_file import read_estimator, write_estimator
from emaphm.arrays import Array, Single
from emaphm.blas_threads import one_blas_thread
from emaphm.recording import Recording
from emaphm.simulation import Inputs


@dataclass(frozen=True, eq=False)
class Estimator(EstimatorContent):
    """A trained estimator: its content, and its answers for recordings."""

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Return the estimator in a file that `emaphm train` wrote.

        Raises
        ------
        MethodError
            The file is absent, too large, damaged, of another version, or no estimator.
        """
        return read_estimator(Path(path), cls)

    def save(self, path: str | Path) -> None:
        """Write the estimator to one file, complete or not at all; `OutputError` if it cannot be written."""
        write_estimator(self, path)

    def check_trained_for(self, actuator: Actuator) -> None:
        """Raise `MethodError` if `actuator` is not the description that the estimator was trained for."""
        check_trained_for(self.setup, actuator)

    def check(self, recording: Recording, actuator: Actuator) -> None:
        """Raise `MethodError` if the estimator cannot evaluate the recording; the message gives a remedy."""
        check_trained_for(self.setup, actuator)
        check_recording(self.setup, recording)

    def rows(self, recording: Recording) -> Single:
        """Return the network's input for a recording that `check` has accepted, (1, channels, blocks)."""
        return in_blocks(rows_of(recording, self.setup.channels), block_of(self.setup.samples))

    @one_blas_thread()
    def answers(self, rows: Single, inputs: Inputs) -> list[Mixture]:
        """Return the posterior of each of n recordings, a mixture; all recordings are driven by `inputs`.

        `rows` is (n, channels, blocks), in the channels' units: the concatenated `Estimator.rows` of n
        recordings.
        """
        return calibrated_answers(self.setup, self.network, self.update, self.temperature, rows, inputs)

    def distances(self, rows: Single) -> Array:
        """Return the distances T² and Q of rows (n, channels, blocks) from the training set, (n, 2)."""
        return self.network.distances(rows)

    def predicted_errors(self, comparison: Comparison) -> Array:
        """Return the predicted error of each answer, relative to the allowed error, (n,)."""
        distances = self.distances(comparison.rows)
        return self.error_predictor.predicted(
            comparison.features(self.setup, self.update.whitening, distances)
        )


def first_answers(network: Network, rows: Single) -> list[Mixture]:
    """Return the first network's posterior for each of the rows (n, channels, blocks)."""
    return network.mixtures(network.features(rows))


def calibrated_answers(
    setup: RecordingSetup,
    network: Network,
    update: ModelUpdate,
    temperature: Array,
    rows: Single,
    inputs: Inputs,
) -> list[Mixture]:
    """Return the posterior by both networks for each of the rows (n, channels, blocks).

    The standard deviations are multiplied by `temperature` (d,).
    """
    updated = update.answers(setup, inputs, rows, first_answers(network, rows))
    return [mixture.scaled(temperature) for mixture in updated]
