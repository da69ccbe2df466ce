"""Test for a delay of one row, of all channels or of the current, by the residuals of shifted recordings.

A delay of a channel by one row is confounded with a changed gain: the residual at the answer stays small.
If the recording is shifted back by the row, the residual at the estimator's answer becomes smaller; if it is
shifted by another row in the direction of the delay, the residual becomes much larger. A delay is accepted if
both are the case. Of some actuators, healthy ones for instance, current and voltage cannot separate a delay
from a gain, and all three residuals are about equal. If a delay of a row would hardly change the residual, a
degraded gain may be a delay.
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
    """Thresholds of the test for a delay.

    There is a delay if, shifted back by `rows`, a recording has a mean squared residual below
    1 / `least_improvement` of that without a shift, and below 1 / `least_contrast` of that with the opposite
    shift. This was so for 94 to 96 of 100 random fault vectors with a delay of plus or minus one row, and for
    none of 100 without a delay; for 1 or 2 of 100 small faults without a delay, and for 9 of 100 vectors with
    heavy shorts.

    A delay of `rows` hardly changes the whitened residual if it does so by less than `least_change` standard
    deviations, after projection on the complement of the answer's uncertainty. This is the case of actuators
    with hardly any fault except a degraded gain.
    """

    rows: int = 1
    least_improvement: float = 1.04
    least_contrast: float = 1.4
    least_change: float = 8.0


DELAYS = DelaySettings()


def shifted_rows(estimator: Estimator, recording: Recording) -> Single:
    """Return the network's input for `recording` without a shift, and with channels a row earlier and later.

    (n, channels, blocks): without a shift first, then a pair for all channels, and a pair for the current.
    """
    setup = estimator.setup
    rows = rows_of(recording, setup.channels)[0]
    rows = rows.reshape(len(setup.channels), -1)
    candidates = [rows]
    for group in _channel_groups(setup).values():
        for delay in (-DELAYS.rows, DELAYS.rows):
            shifted = rows.copy()
            shifted[group] = taken_back(rows[group], delay)
            candidates.append(shifted)
    return in_blocks(np.array(candidates), block_of(setup.samples))


def delay_clause(estimator: Estimator, comparison: Comparison) -> str | None:
    """Return the clause that channels seem late or early, or that the gain may be a delay; None if neither.

    `comparison` is that of `shifted_rows` with its answers. A degraded gain may be a delay if a delay of a
    row would hardly change the residual.
    """
    groups = _channel_groups(estimator.setup)
    (unshifted, *shifted), change = _residual_sizes(estimator, comparison)
    delayed = [
        (min(pair), name, "late" if pair[1] < pair[0] else "early")
        for name, pair in zip(groups, zip(shifted[::2], shifted[1::2], strict=True), strict=True)
        if unshifted > DELAYS.least_improvement * min(pair) and max(pair) > DELAYS.least_contrast * min(pair)
    ]
    if delayed:
        _, name, direction = min(delayed)
        return f"{name} seems to come a row {direction}: shifted back, its residual is smaller"
    space, answer = estimator.space, comparison.answers[0]
    gain = estimates(space, space.project(answer.mean), answer.covariance)["gain"]
    if gain.verdict == "degraded" and change < DELAYS.least_change:
        return (
            "its gain may be a delay: a delay of one row would change the residual by only "
            f"{change:.2g} standard deviations, less than {DELAYS.least_change:g}"
        )
    return None


def _channel_groups(setup: RecordingSetup) -> dict[str, slice]:
    """Return the groups of channels that may have a common delay, by name."""
    groups = {"all that was measured": slice(None)}
    if len(setup.channels) > 1:
        groups[setup.channels[0]] = slice(1)
    return groups


def _residual_sizes(estimator: Estimator, comparison: Comparison) -> tuple[list[float], float]:
    """Return the mean squared whitened residual of each recording at its answer.

    Second: the change of the first recording's residual by a delay of a row, in standard deviations.
    """
    residuals, lengths = comparison.residuals(estimator.update.whitening)
    change = DELAYS.rows * lengths[0, ALL_LATE] / block_of(estimator.setup.samples)
    return [float(value) for value in np.mean(residuals**2, axis=1)], float(change)
