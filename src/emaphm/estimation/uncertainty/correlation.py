"""Correlation of a residual: its largest integral time, and its white noise."""

from collections.abc import Iterable, Sequence

import numpy as np

from emaphm.arrays import Array
from emaphm.quantiles import chi_squared_quantile

BANDS = (1, 2, 4, 8, 16, 32)
"""Band widths, in frequencies, over which a spectrum is averaged; all are evaluated: narrow bands resolve a
long correlation, wide bands have less random error."""

CHANCE = 0.05
"""Probability that white noise has a significant band."""

NOISE_BANDS = 8
"""Number of bands of a spectrum; the least dense band is assumed to contain only white noise."""

ROUNDING = 1e-9
"""Allowance for rounding errors in a number of frequencies."""


def integral_time(residuals: Sequence[Array], intervals: Sequence[float]) -> float:
    """Return the largest integral time [s] of residuals (samples,) whose rows are `intervals` [s] apart.

    It is the peak of their spectrum divided by their variance,

        T = max_f S(f) / σ²,    Var Σ c_i r_i ≤ (T / Δt) σ² Σ c_i²   for any c,

    which is Δt for white noise, and the usual integral time if the spectrum has its peak at 0. The spectra
    are averaged over the recordings and over bands of several widths; the result is the largest significant
    peak minus its standard error, at least Δt, at most the length of a recording.
    """
    largest = max(_largest_integral_time(residuals, intervals, width) for width in BANDS)
    longest = max(len(residual) * interval for residual, interval in zip(residuals, intervals, strict=True))
    return min(max(largest, min(intervals)), longest)


def longest_correlation(residuals: Iterable[Array]) -> float:
    """Return the largest integral time of the `residuals` (samples,) of channels, in rows, at least 1."""
    return max((integral_time([residual], [1.0]) for residual in residuals if residual.any()), default=1.0)


def _largest_integral_time(residuals: Sequence[Array], intervals: Sequence[float], width: int) -> float:
    """Return the largest integral time [s] from bands of `width` frequencies, 0 without a significant band.

    The frequencies are those of the shortest recording; longer recordings have more frequencies in a band and
    a correspondingly larger weight.
    """
    lengths = np.array([len(residual) for residual in residuals])
    durations = lengths * np.array(intervals)
    per_band = width * durations / durations.min()
    bands = int(np.min(lengths // 2 / per_band) + ROUNDING)
    if bands < 1:
        return 0.0
    total, number = np.zeros(bands), np.zeros(bands)
    for residual, interval, frequencies in zip(residuals, intervals, per_band, strict=True):
        square = float(np.mean(residual**2))
        if not square > 0:
            return 0.0
        power = _power(residual)
        band = ((np.arange(power.size) + ROUNDING) / frequencies).astype(int)
        total += np.bincount(band, power / square * interval, minlength=bands)[:bands]
        number += np.bincount(band, minlength=bands)[:bands]
    densest = int(np.argmax(total / number))
    freedom, peak = 2 * int(number[densest]), float(total[densest] / number[densest])
    white = float(np.average(intervals, weights=durations))
    by_chance = chi_squared_quantile(freedom, 1 - CHANCE / (bands * len(BANDS))) / freedom * white
    return peak / (1 + (2 / freedom) ** 0.5) if peak > by_chance else 0.0


def _power(residual: Array) -> Array:
    """Return the periodogram (samples // 2 + 1,) from frequency 0 on; its mean is 1 for unit white noise."""
    return np.asarray(np.abs(np.fft.rfft(residual)) ** 2 / len(residual))


def white_noise(residual: Array) -> float:
    """Return the rms of the largest white noise that a `residual` (samples,) may contain, in its unit.

    White noise has the same density in every band of the spectrum, so at most the least density of
    `NOISE_BANDS` bands.
    """
    power = _power(residual)[1:]
    return float(
        min(float(band.mean()) for band in np.array_split(power, min(NOISE_BANDS, power.size))) ** 0.5
    )
