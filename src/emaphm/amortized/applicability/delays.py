"""Whether a recording would be understood better had it come a row earlier or later.

A channel that comes a row late is taken up as another gain, and what is left of it at the answer looks like
little. Asked about the same recording with the row taken back, the estimator finds an answer that leaves
less; with a row more in the same direction, one that leaves much more. Only both together say that there is
a delay: of some actuators, healthy ones for instance, current and voltage do not tell a delay from a gain,
and all three leave about the same. Where a row of delay would hardly show, a degraded gain may be one.
"""

from dataclasses import dataclass

import numpy as np

from emaphm.amortized.error_prediction.comparison import Comparison
from emaphm.amortized.error_prediction.deviations import ALL_LATE
from emaphm.amortized.estimator import Estimator
from emaphm.amortized.recording_setup import RecordingSetup, rows_of
from emaphm.amortized.simulating import block_of, in_blocks
from emaphm.arrays import Single
from emaphm.diagnosis.explanation.alternatives import taken_back
from emaphm.diagnosis.verdict import estimates
from emaphm.recording import Recording


@dataclass(frozen=True)
class DelaySettings:
    """When another time fits better.

    Taken `rows` back, a recording leaves less than a share of 1 / `better` of the mean squared residual, and
    less than 1 / `decided` of what it leaves `rows` farther off. Of 100 random vectors that came one row late
    or early 94 to 96 did, of as many in time none; of 100 small faults in time 1 or 2, of 100 vectors with
    heavy shorts 9.

    A delay of `rows` hardly shows where it changes the whitened residual by less than `shown` standard
    deviations, what the answer's uncertainty takes up apart: of actuators with little but a degraded gain.
    """

    rows: int = 1
    better: float = 1.04
    decided: float = 1.4
    shown: float = 8.0


DELAYS = DelaySettings()


def in_time_and_moved(estimator: Estimator, recording: Recording) -> Single:
    """Return what the network reads of a `recording`, and of it with channels a row earlier and later.

    (n, channels, blocks): as recorded first; then a pair for all that was measured, and one for the current.
    """
    setup = estimator.setup
    rows = rows_of(recording, setup.channels)[0]
    rows = rows.reshape(len(setup.channels), -1)
    tried = [rows]
    for which in _kinds(setup).values():
        for late in (-DELAYS.rows, DELAYS.rows):
            moved = rows.copy()
            moved[which] = taken_back(rows[which], late)
            tried.append(moved)
    return in_blocks(np.array(tried), block_of(setup.samples))


def found_delay(estimator: Estimator, comparison: Comparison) -> str | None:
    """Return what of a recording seems to come late or early, a clause; None where nothing does.

    `comparison` is that of `in_time_and_moved`. Where a delay would not show, a degraded gain may be one.
    """
    kinds = _kinds(estimator.setup)
    (in_time, *others), shown = _left(estimator, comparison)
    found = [
        (min(pair), name, "late" if pair[1] < pair[0] else "early")
        for name, pair in zip(kinds, zip(others[::2], others[1::2], strict=True), strict=True)
        if in_time > DELAYS.better * min(pair) and max(pair) > DELAYS.decided * min(pair)
    ]
    if found:
        _, name, way = min(found)
        return f"{name} seems to come a row {way}: taken back, it leaves less"
    space, answer = estimator.space, comparison.answers[0]
    gain = estimates(space, space.project(answer.mean), answer.covariance)["gain"]
    if gain.verdict == "degraded" and shown < DELAYS.shown:
        return (
            "its gain may be a delay: one of a row would change what the answer leaves of it by "
            f"{shown:.2g} standard deviations only, less than {DELAYS.shown:g}"
        )
    return None


def _kinds(setup: RecordingSetup) -> dict[str, slice]:
    """Return which channels may come late together, by name."""
    kinds = {"all that was measured": slice(None)}
    if len(setup.channels) > 1:
        kinds[setup.channels[0]] = slice(1)
    return kinds


def _left(estimator: Estimator, comparison: Comparison) -> tuple[list[float], float]:
    """Return the mean squared residual of each recording at its answer, whitened.

    And how many standard deviations a delay of a row makes in that of the first one.
    """
    residuals, lengths = comparison.residuals(estimator.update.whitening)
    shown = DELAYS.rows * lengths[0, ALL_LATE] / block_of(estimator.setup.samples)
    return [float(value) for value in np.mean(residuals**2, axis=1)], float(shown)
