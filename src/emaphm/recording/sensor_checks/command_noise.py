"""Noise of a recorded command that the drive's own command does not have.

A drive amplifies its command: for the thesis's actuator, 10 µrad are 0.7 A. A recorder that rounds the
command, adds noise or stamps its rows inexactly thus records another command than the drive received, and a
model that replays it has a current that the actuator did not have. Laws that filter the command, such as a
lag, then seem to act. Noise that the drive did receive appears in the recorded current, and is kept.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from emaphm.actuator import Actuator
from emaphm.actuator.quantity import unit_for
from emaphm.arrays import Array
from emaphm.recording.jumps import Jumps
from emaphm.recording.noise import robust_noise_level
from emaphm.recording.recording import Recording
from emaphm.recording.schema import SCHEMA
from emaphm.recording.sensor_checks.finding import SensorFinding

COMMAND = "command_rad"

CURRENT = "current_A"

FAST_DRIVES = ("hysteresis", "current")
"""Drives whose current follows its demand within a row. Behind a PI controller of the current, the share of
received noise that the current follows was 0.05 to 0.14, too small to tell it from noise of the recorder."""


@dataclass(frozen=True)
class CommandNoiseSettings:
    """Limits from which noise of the command counts as noise of the recorder.

    Noise is computed from differences of `order`. If it is white, it is the same from `higher` ones, within
    the factor `white`; differences of a smooth signal become smaller with their order. Its effect on the
    current of the model is at least `effect` of the noise and ripple of the recorded current.

    A drive that receives the noise responds to it with the gain of its loops: in 27 simulated recordings at 1
    to 10 kHz, at steps or as a line through the rows, the share was 0.33 to 1.9, at 0.33 to 0.65 with the
    least position gain. At most `followed` counts as noise of the recorder; the current may be up to `latest`
    rows late or early. The response falls with the interval between rows, which may be `slowest` times the
    time constant of the speed loop. Stretches of the command between jumps have at least `fewest` rows.
    """

    order: int = 6
    higher: int = 8
    white: float = 1.5
    effect: float = 0.5
    followed: float = 0.2
    latest: int = 8
    slowest: float = 2.5
    fewest: int = 50


COMMAND_NOISE = CommandNoiseSettings()

STRENGTHS = 10.0 ** np.arange(-1, 9.1, 0.25)
"""Weights of the third differences in the smoothing, from nearly none to a cut-off of 1/200 of the rows."""


def smoothed_command(recording: Recording, actuator: Actuator) -> tuple[Array, SensorFinding] | None:
    """Return the command without noise of the recorder [rad; m if linear], (samples,), and the finding.

    None if it has no such noise, or too little to matter.
    """
    gain = _current_per_command(recording, actuator)
    if CURRENT not in recording or gain is None:
        return None
    command, current = recording[COMMAND], recording[CURRENT]
    noise = robust_noise_level(command, COMMAND_NOISE.order)
    ratio = noise / max(robust_noise_level(command, COMMAND_NOISE.higher), np.finfo(float).tiny)
    is_white = 1 / COMMAND_NOISE.white < ratio < COMMAND_NOISE.white
    least = COMMAND_NOISE.effect * robust_noise_level(current, COMMAND_NOISE.order)
    if noise == 0 or not is_white or gain * noise < least:
        return None
    pieces = list(_pieces_without_jumps(recording))
    if not pieces or _followed_share(command, current, pieces, gain) > COMMAND_NOISE.followed:
        return None
    values = command.copy()
    for piece in pieces:
        values[piece] = smoothed(command[piece])
    unit = unit_for(SCHEMA[COMMAND].unit, actuator.coordinates)
    sentence = (
        f"{COMMAND} has noise of {noise:.2g} {unit} rms that {CURRENT} does not follow: the drive received "
        "another command than the recorded one. The command is smoothed; record it without noise, in fine "
        "counts and at exact times"
    )
    return values, SensorFinding(COMMAND, "noise", noise, unit, sentence)


def with_smoothed_command(recording: Recording, actuator: Actuator) -> Recording:
    """Return `recording` with `smoothed_command` and a note on it, or unchanged."""
    smooth = smoothed_command(recording, actuator)
    if smooth is None:
        return recording
    values, finding = smooth
    return recording.with_channels({**recording.channels, COMMAND: values}, (finding.sentence,))


def _current_per_command(recording: Recording, actuator: Actuator) -> float | None:
    """Return the current per jump of the command [A/rad; A/m]; None if it does not follow within a row."""
    if actuator.drive_kind not in FAST_DRIVES:
        return None
    controller = actuator.controller
    slowest = COMMAND_NOISE.slowest * actuator.mechanics.inertia / controller.speed_gain
    if recording.interval_s > slowest or (controller.command_lag or 0.0) > recording.interval_s:
        return None
    return controller.position_gain * controller.speed_gain / actuator.drive_constant


def _pieces_without_jumps(recording: Recording) -> Iterator[slice]:
    """Yield the stretches of rows between jumps of the command that are long enough for differences."""
    command = recording[COMMAND]
    jumps = Jumps.of(command, means=recording.sampling == "mean")
    firsts = np.concatenate([[0], jumps.after])
    ends = np.concatenate([jumps.before + 1, [command.size]])
    for first, end in zip(firsts, ends, strict=True):
        if end - first > COMMAND_NOISE.fewest:
            yield slice(int(first), int(end))


def _followed_share(command: Array, current: Array, pieces: list[slice], gain: float) -> float:
    """Return the upper end of the share of the command's noise that the current follows, late or early.

    Each piece of the current is compared without its first and last rows, with the rows of the command that
    are up to `latest` rows earlier or later.
    """
    latest, order = COMMAND_NOISE.latest, COMMAND_NOISE.order
    causes = [np.diff(command[piece], order) for piece in pieces]
    effect = np.concatenate([np.diff(current[piece], order)[latest:-latest] for piece in pieces])
    ends = []
    for first in range(2 * latest + 1):
        cause = np.concatenate([rows[first : rows.size - 2 * latest + first] for rows in causes])
        ends.append(_upper_end(cause, effect))
    return max(ends) / gain


def _upper_end(cause: Array, effect: Array) -> float:
    """Return the coefficient of the regression of `effect` on `cause`, (n,), plus three standard errors.

    The correlation of the differences from row to row is taken into account.
    """
    power = float(cause @ cause)
    coefficient = float(cause @ effect) / power
    scores = cause * (effect - coefficient * cause)
    lags = range(1, min(2 * COMMAND_NOISE.order, scores.size))
    variance = float(scores @ scores) + 2 * sum(float(scores[:-lag] @ scores[lag:]) for lag in lags)
    return coefficient + 3 * math.sqrt(max(variance, 0.0)) / power


def smoothed(values: Array) -> Array:
    """Return `values` (n,) without noise: a Whittaker smoother of third differences (Eilers 2003).

    It minimises the squared residuals plus a weight times the squared third differences. The weight is that
    of the least generalised cross-validation (Craven, Wahba 1979), with the trace of the smoother from its
    frequency response. *Validity:* white noise.
    """
    from scipy.linalg import solveh_banded

    n, penalties = values.size, _penalties(values.size)
    frequencies = np.pi * (np.arange(n) + 0.5) / n
    response = (2 * np.sin(frequencies / 2)) ** 6
    best, least = values, math.inf
    for strength in STRENGTHS:
        banded = strength * penalties
        banded[-1] += 1.0
        candidate = np.asarray(solveh_banded(banded, values, check_finite=False))
        free = 1 - float(np.mean(1 / (1 + strength * response)))
        score = float(np.mean((values - candidate) ** 2)) / free**2
        if score < least:
            best, least = candidate, score
    return best


def _penalties(n: int) -> Array:
    """Return the upper bands (4, n) of D'D, with D the third differences of n rows."""
    coefficients = np.array([-1.0, 3.0, -3.0, 1.0])
    bands = np.zeros((4, n))
    for offset in range(4):
        for first in range(4 - offset):
            product = coefficients[first] * coefficients[first + offset]
            bands[3 - offset, first + offset : n - 3 + first + offset] += product
    return bands
