"""Detection of two channels with exchanged names, by a replay of the healthy actuator."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from emaphm.actuator import Actuator
from emaphm.actuator.faults import HEALTHY
from emaphm.arrays import Array, rms
from emaphm.estimation.posing import problem_of
from emaphm.recording.sensor_checks import CheckedRecording, SensorFinding
from emaphm.simulation import Model


@dataclass(frozen=True)
class SwapSettings:
    """Limits at which two channels count as exchanged.

    Faults change the signals of an actuator, but not into those of another sensor. Two channels count as
    exchanged if the exchange reduces the sum of their distances from the model to less than `nearer` times,
    and one distance to less than `nearest` of the model's rms. With large faults, the distance of a current
    is larger than that.
    """

    nearer: float = 0.45
    nearest: float = 0.6


SWAP = SwapSettings()


def with_channels_exchanged(checked: CheckedRecording, actuator: Actuator, model: Model) -> CheckedRecording:
    """Return the recording with two wrongly named channels exchanged, and the finding.

    The rows that are not compared are exchanged, too; findings keep the original names. The recording is
    returned unchanged if no channels are exchanged, or if fewer than two channels can be compared.
    """
    problem = problem_of(checked.recording, actuator, model, channels=None)
    if len(problem.channels) < 2:
        return checked
    modelled = problem.predict(HEALTHY.vector[np.newaxis])[0]
    measured = [problem.measured[name] for name in problem.channels]
    pair = _exchanged_pair(measured, list(modelled))
    if pair is None:
        return checked
    a, b = (problem.channels[i] for i in pair)
    sentence = (
        f"{a} and {b} are in each other's place: they agree with the model after an exchange, and were "
        "exchanged. Check the names under [channels]"
    )
    swapped = {**problem.measured, a: problem.measured[b], b: problem.measured[a]}
    finding = SensorFinding(f"{a} and {b}", "swapped", 2.0, "channels", sentence)
    exchanged = {a: b, b: a}
    return CheckedRecording(
        checked.recording.with_channels(swapped, [sentence]),
        {exchanged.get(name, name): rows for name, rows in checked.unusable.items()},
        (*checked.findings, finding),
    )


def _exchanged_pair(measured: Sequence[Array], modelled: Sequence[Array]) -> tuple[int, int] | None:
    """Return the pair of signals that fit the model when exchanged, the best pair of several."""

    def distance(i: int, j: int) -> float:
        size = rms(modelled[j] - modelled[j].mean())
        return rms(measured[i] - modelled[j]) / size if size > 0 else np.inf

    fits = {}
    for i, j in combinations(range(len(measured)), 2):
        named, crossed = (distance(i, i), distance(j, j)), (distance(i, j), distance(j, i))
        if min(crossed) < SWAP.nearest and sum(crossed) < SWAP.nearer * sum(named):
            fits[i, j] = sum(crossed) / sum(named)
    return min(fits, key=lambda pair: fits[pair]) if fits else None
