"""An estimator: a network, trained on an actuator's own simulations, that names a recording's faults."""

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
    """A trained estimator: its content, and what it makes of recordings."""

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
        """Write one file, as a whole; `OutputError` where it cannot be written."""
        write_estimator(self, path)

    def check_trained_for(self, actuator: Actuator) -> None:
        """Refuse another description than the one that it was trained for, `MethodError`."""
        check_trained_for(self.setup, actuator)

    def check(self, recording: Recording, actuator: Actuator) -> None:
        """Refuse a recording that the estimator cannot be asked about; `MethodError` gives the way out."""
        check_trained_for(self.setup, actuator)
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
        return self.network.distances(rows)

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
