"""Parallel filtering: speed and acceleration from the position, and one low-pass for the regression.

Inverse dynamics needs the acceleration, which is not measured. It is computed by a Butterworth low-pass
without phase shift and central differences, in the frequency range in which the position exceeds its noise.
A second low-pass acts on both sides of the regression equally, so that it reduces noise without a bias; the
rows are then thinned according to its cutoff (Gautier 1997; Janot, Vandanjon and Gautier 2014).
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Self

import numpy as np
from numpy.typing import NDArray

from emaphm.arrays import Array, runs
from emaphm.errors import MethodError

SIGNAL_TO_NOISE = 10.0
"""Least ratio of the position's spectrum to that of its noise at which the position is used."""

FLOOR_BAND = 0.8
"""Frequency, relative to the Nyquist frequency, above which the position's spectrum counts as noise."""

POSITION_BAND = 0.8
"""Highest cutoff of the position's low-pass, relative to the Nyquist frequency."""

REGRESSION_SHARE = 0.5
"""Cutoff of the regression relative to that of the position. At half its cutoff, the position's low-pass
reduces a signal by 0.4 %: 1 - 1 / (1 + 0.5⁸)."""

ORDER = 4
"""Order of both Butterworth low-passes. They run forwards and backwards, which doubles the order."""

ROWS_PER_CUTOFF = 2.5
"""Rate of the rows kept, relative to the cutoff of the regression: further rows would be redundant."""

SPECTRUM_SEGMENTS = 8
"""Number of segments over which the spectrum of a recording is averaged, half overlapping (Welch 1967)."""

LEAST_ROWS = 64
"""Least number of rows of a recording for the choice of a frequency from its spectrum."""


@dataclass(frozen=True)
class FilterFrequencies:
    """Cutoff frequencies of the low-pass on the position and of the low-pass on the regression [Hz].

    `speed_noise` is the rms of the speed due to the position's white noise: √(N (2π)² f³ / 3) for a noise of
    density N up to the cutoff f, in the position's unit per second.
    """

    position_hz: float
    regression_hz: float
    speed_noise: float

    @classmethod
    def of(
        cls,
        position: Array,
        interval: float,
        *,
        position_hz: float | None = None,
        regression_hz: float | None = None,
    ) -> Self:
        """Return the frequencies for a `position` (n,) [rad] with rows `interval` [s] apart.

        Given frequencies are used. Otherwise, the position's cutoff is the lowest frequency at which its
        spectrum is less than `SIGNAL_TO_NOISE` times that of its noise, which is the median above
        `FLOOR_BAND` of the Nyquist frequency.

        Raises
        ------
        MethodError
            There are too few rows, or a given frequency is not between 0 and the Nyquist frequency.
        """
        from scipy import signal

        if position.size < LEAST_ROWS:
            raise MethodError(
                f"{position.size} rows are too few for inverse dynamics; record {LEAST_ROWS} or more"
            )
        nyquist = 0.5 / interval
        segment = 2 * position.size // (SPECTRUM_SEGMENTS + 1)
        # The spectrum of second differences: otherwise the slow motion would leak into high frequencies.
        frequency, spectrum = signal.welch(np.diff(position, 2), 1 / interval, nperseg=segment)
        frequency, spectrum = (
            frequency[1:],
            spectrum[1:] / (2 * np.sin(np.pi * frequency[1:] * interval)) ** 4,
        )
        floor = float(np.median(spectrum[frequency > FLOOR_BAND * nyquist]))
        noisy = np.flatnonzero(spectrum < SIGNAL_TO_NOISE * floor)
        cutoff = float(frequency[noisy[0]]) if noisy.size else nyquist
        cutoff = min(max(cutoff, float(frequency[0])), POSITION_BAND * nyquist)
        position_hz = cutoff if position_hz is None else position_hz
        regression_hz = REGRESSION_SHARE * position_hz if regression_hz is None else regression_hz
        for name, value in (("position_hz", position_hz), ("regression_hz", regression_hz)):
            if not 0 < value < nyquist:
                raise MethodError(
                    f"{name}, {value:g} Hz, must lie between 0 and half the sample rate, {nyquist:g} Hz"
                )
        return cls(position_hz, regression_hz, 2 * np.pi * (floor * position_hz**3 / 3) ** 0.5)


def low_pass(values: Array, cutoff_hz: float, interval: float) -> Array:
    """Return `values` (…, n) after a Butterworth low-pass that runs forwards and backwards, (…, n)."""
    from scipy import signal

    settling = int(min(3 / (cutoff_hz * interval), values.shape[-1] - 1))
    return np.asarray(signal.sosfiltfilt(_sections(cutoff_hz, interval), values, axis=-1, padlen=settling))


@lru_cache
def _sections(cutoff_hz: float, interval: float) -> Array:
    """Return the low-pass as second-order sections; cached, because a search filters hundreds of times."""
    from scipy import signal

    return np.asarray(signal.butter(ORDER, cutoff_hz, fs=1 / interval, output="sos"))


def first_order_lag(values: Array, lag: float, interval: float) -> Array:
    """Return `values` (n,) after a first-order lag of time constant `lag` [s], with linear interpolation.

    Before the first row, the input is assumed to have the value of the first row.

    T dy/dt = x - y:   y⁺ = e y + (q - e) x + (1 - q) x⁺,   e = exp(-Δt / T),   q = (1 - e) T / Δt
    """
    from scipy import signal

    if lag < 1e-3 * interval:
        return values
    decay = np.exp(-interval / lag)
    chord = (1 - decay) * lag / interval
    start = [chord * values[0]]
    return np.asarray(
        signal.lfilter([1 - chord, chord - decay], [1, -decay], values, zi=start)[0], dtype=np.float64
    )


@dataclass(frozen=True, eq=False)
class RowThinning:
    """The rows of a recording that the regression uses, and the low-pass before it.

    `kept` are row numbers, one of each `step` rows; rows within a period of the cutoff from either end are
    left out.
    """

    cutoff_hz: float
    interval: float
    kept: NDArray[np.intp]
    step: int

    @classmethod
    def of(cls, moving: NDArray[np.bool_], cutoff_hz: float, interval: float) -> Self:
        """Return the thinning of a recording; `moving` (n,) states whether the shaft moves in each row.

        A standstill of at least half a period of the cutoff is left out, including a quarter period on either
        side, which the low-pass affects. A reversal is shorter and is not left out.
        """
        quarter = max(1, round(0.25 / (cutoff_hz * interval)))
        usable = np.ones(moving.size, bool)
        for first, after in runs(~moving):
            if after - first >= 2 * quarter:
                usable[max(first - quarter, 0) : after + quarter] = False
        step = max(1, int(1 / (ROWS_PER_CUTOFF * cutoff_hz * interval)))
        margin = min(4 * quarter, moving.size // 4)
        rows = np.arange(margin, moving.size - margin, step)
        return cls(cutoff_hz, interval, rows[usable[rows]], step)

    def __call__(self, values: Array) -> Array:
        """Return `values` (…, n) after the low-pass, at the rows kept, (…, rows)."""
        return low_pass(values, self.cutoff_hz, self.interval)[..., self.kept]
