"""Parallel filtering: position to speed and acceleration, and a regression through one low-pass.

Inverse dynamics needs the acceleration, which measurements do not give. A Butterworth low-pass without phase
shift and central differences give it where the position stands above its noise. A second low-pass acts on
both sides of the regression alike, so that it removes noise without a bias, and the rows are thinned to what
it leaves (Gautier 1997; Janot, Vandanjon and Gautier 2014).
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Self

import numpy as np
from numpy.typing import NDArray

from emaphm.arrays import Array, runs
from emaphm.errors import MethodError

SIGNAL_TO_NOISE = 10.0
"""Ratio of the spectra of position and of its noise down to which the position is used."""

FLOOR_BAND = 0.8
"""Share of the Nyquist frequency above which the position's spectrum is taken for noise."""

POSITION_BAND = 0.8
"""Highest cutoff of the position's low-pass, relative to the Nyquist frequency."""

REGRESSION_SHARE = 0.5
"""Cutoff of the regression relative to the position's. At half its cutoff the position's low-pass loses
0.4 %: 1 - 1 / (1 + 0.5⁸)."""

ORDER = 4
"""Order of either Butterworth low-pass. It runs forwards and backwards, which doubles it."""

ROWS_PER_CUTOFF = 2.5
"""Rows kept, relative to the cutoff of the regression: more would only repeat each other."""

SPECTRUM_SEGMENTS = 8
"""Parts of a recording that its spectrum is averaged over, half overlapping (Welch 1967)."""

LEAST_ROWS = 64
"""Rows below which a recording has no spectrum to choose a frequency from."""


@dataclass(frozen=True)
class FilterFrequencies:
    """Cutoff frequencies of the low-pass on the position and of that on the regression [Hz].

    `speed_noise` is the rms that the position's white noise leaves in the speed: of a noise of density N,
    up to the cutoff f, √(N (2π)² f³ / 3), in the position's unit per second.
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
        """Return the frequencies for a `position` (n,) [rad] with rows `interval` [s] apart; given ones hold.

        The position's cutoff is the lowest frequency at which its spectrum is less than `SIGNAL_TO_NOISE`
        times that of its noise, which is the median above `FLOOR_BAND` of the Nyquist frequency.

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
        # Of the second differences, so that the slow motion does not leak into the high frequencies.
        frequency, spectrum = signal.welch(np.diff(position, 2), 1 / interval, nperseg=segment)
        frequency, spectrum = (
            frequency[1:],
            spectrum[1:] / (2 * np.sin(np.pi * frequency[1:] * interval)) ** 4,
        )
        floor = float(np.median(spectrum[frequency > FLOOR_BAND * nyquist]))
        noisy = np.flatnonzero(spectrum < SIGNAL_TO_NOISE * floor)
        found = float(frequency[noisy[0]]) if noisy.size else nyquist
        upper = min(max(found, float(frequency[0])), POSITION_BAND * nyquist)
        position_hz = upper if position_hz is None else position_hz
        regression_hz = REGRESSION_SHARE * position_hz if regression_hz is None else regression_hz
        for name, value in (("position_hz", position_hz), ("regression_hz", regression_hz)):
            if not 0 < value < nyquist:
                raise MethodError(
                    f"{name}, {value:g} Hz, must lie between 0 and half the sample rate, {nyquist:g} Hz"
                )
        return cls(position_hz, regression_hz, 2 * np.pi * (floor * position_hz**3 / 3) ** 0.5)


def low_pass(values: Array, cutoff_hz: float, interval: float) -> Array:
    """Return `values` (…, n) through a Butterworth low-pass that runs forwards and backwards, (…, n)."""
    from scipy import signal

    settling = int(min(3 / (cutoff_hz * interval), values.shape[-1] - 1))
    return np.asarray(signal.sosfiltfilt(_sections(cutoff_hz, interval), values, axis=-1, padlen=settling))


@lru_cache
def _sections(cutoff_hz: float, interval: float) -> Array:
    """Return the low-pass in second-order sections; a search filters hundreds of times by the same."""
    from scipy import signal

    return np.asarray(signal.butter(ORDER, cutoff_hz, fs=1 / interval, output="sos"))


def first_order_lag(values: Array, lag: float, interval: float) -> Array:
    """Return `values` (n,) through a first-order lag of time constant `lag` [s], straight between rows.

    Before the first row, they are taken to have been as there.

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
    """Which rows of a recording the regression keeps, and the low-pass before it.

    `kept` are row numbers, one of each `step`; rows within a period of the cutoff of either end are left out.
    """

    cutoff_hz: float
    interval: float
    kept: NDArray[np.intp]
    step: int

    @classmethod
    def of(cls, moving: NDArray[np.bool_], cutoff_hz: float, interval: float) -> Self:
        """Return the thinning of a recording whose shaft is `moving` (n,) or not.

        A standstill of half a period of the cutoff or longer is left out, with a quarter period on either
        side, into which the low-pass carries it. A reversal passes faster.
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
        """Return `values` (…, n) through the low-pass, at the rows kept."""
        return low_pass(values, self.cutoff_hz, self.interval)[..., self.kept]
