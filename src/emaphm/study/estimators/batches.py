"""Number of recordings that a core answers per second, for as many recordings as the archive of a fleet has.

    python -m emaphm.study.estimators.batches unit.estimator unit.training --most 100000

answers the simulations of a training folder (`emaphm train --folder`), with noise, in batches. The estimator
was trained on most of them: their errors only verify that answers and recordings correspond.
docs/fast_estimator.md quotes the result.
"""

import argparse
import sys
import time
from pathlib import Path

import numpy as np

from emaphm.actuator import Chirp
from emaphm.amortized import Estimator
from emaphm.amortized.networks.training import with_noise
from emaphm.amortized.simulating import TrainingSet, noise_rms, read_shard
from emaphm.diagnosis.verdict import Z95
from emaphm.errors import EmaphmError, StudyError
from emaphm.random_streams import stream
from emaphm.simulation import AVERAGED


def answered(path: Path, folder: Path, most: int) -> str:
    """Return a line on up to `most` simulations in `folder`, answered by the estimator in a file at `path`.

    Raises
    ------
    StudyError
        The folder contains no simulations of this estimator's setup.
    """
    estimator = Estimator.load(path)
    setup, faults = estimator.setup, len(estimator.space.columns)
    inputs = setup.inputs(Chirp(), AVERAGED.step_for(setup.actuator))
    shape = (len(setup.channels), estimator.network.projection.mean.size // len(setup.channels))
    seconds, errors, within = 0.0, [np.zeros(0)], [np.zeros((0, faults), bool)]
    for number, file in enumerate(sorted(folder.glob("shard-*.npz"))):
        shard = read_shard(file)
        if shard is None or shard[1].shape[1:] != shape:
            raise StudyError(f"{file}: no simulations of this estimator's manoeuvre; give its own folder")
        remaining = most - sum(map(len, errors))
        if remaining <= 0:
            break
        draws = TrainingSet(*shard)[:remaining]
        rows = with_noise(draws, noise_rms(setup), stream(0, "noise of a batch", number))
        began = time.process_time()
        answers = estimator.answers(rows, inputs)
        seconds += time.process_time() - began
        difference = np.array([answer.mean for answer in answers])[:, :faults] - draws.points[:, :faults]
        deviations = np.sqrt([np.diag(answer.covariance)[:faults] for answer in answers])
        errors.append(100 * np.sqrt(np.sum(difference**2, axis=1)))
        within.append(np.abs(difference) <= Z95 * deviations)
    error, covered = np.concatenate(errors), np.concatenate(within)
    if not error.size:
        raise StudyError(f"{folder}: no simulations; give the --folder of an 'emaphm train'")
    return (
        f"{error.size:,} recordings in {seconds:.0f} s of processor time, {error.size / seconds:,.0f} per "
        f"second and core; error {np.median(error):.2f} % (median), {np.quantile(error, 0.95):.2f} % (95th "
        f"percentile); coverage {100 * covered.mean(axis=0).min():.1f} to "
        f"{100 * covered.mean(axis=0).max():.1f} %"
    )


def main() -> None:
    """Run with the arguments of the command line."""
    parser = argparse.ArgumentParser(prog="python -m emaphm.study.estimators.batches", description=__doc__)
    parser.add_argument("estimator", type=Path, help="file of 'emaphm train'")
    parser.add_argument("folder", type=Path, help="its simulations, by 'emaphm train --folder'")
    parser.add_argument("--most", type=int, default=100_000, help="largest number of recordings answered")
    arguments = parser.parse_args()
    print(answered(arguments.estimator, arguments.folder, arguments.most))


if __name__ == "__main__":
    try:
        main()
    except EmaphmError as error:
        sys.exit(f"error: {error}")
