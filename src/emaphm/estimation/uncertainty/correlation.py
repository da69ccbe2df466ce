"""How long a residual remembers: its largest integral time, and what of it is white."""

from collections.abc import Iterable, Sequence

import numpy as np

from emaphm.arrays import Array
from emaphm.quantiles import chi_squared_quantile

BANDS = (1, 2, 4, 8, 16, 32)
"""Frequencies that a spectrum is averaged over, each tried: a narrow band shows a long memory, a wide one is
free of chance."""

CHANCE = 0.05
"""Probability with which white noise has any band as dense as one that counts."""

NOISE_BANDS = 8
"""Bands of a spectrum of which the least dense one is taken for the white noise alone."""

ROUNDING = 1e-9
"""What a number of frequencies may be off by the arithmetic."""


def integral_time(residuals: Sequence[Array], intervals: Sequence[float]) -> float:
    """Return the largest integral time [s] of residuals (samples,) whose rows are `intervals` [s] apart.

    The peak of their spectrum over their variance,

        T = max_f S(f) / σ²,    Var Σ c_i r_i ≤ (T / Δt) σ² Σ c_i²   for any c,

    so Δt of white noise, and the usual integral time where the spectrum has its peak at 0. Of spectra
    averaged over the recordings and over bands of several widths, the largest peak that white noise does not
    make by chance, less its standard error; Δt at least, a recording's length at most.
    """
    largest = max(_largest(residuals, intervals, width) for width in BANDS)
    longest = max(len(one) * interval for one, interval in zip(residuals, intervals, strict=True))
    return min(max(largest, min(intervals)), longest)


def longest_correlation(residuals: Iterable[Array]) -> float:
    """Return over how many rows the residuals (samples,) of channels are correlated, at most; 1 at least."""
    return max((integral_time([one], [1.0]) for one in residuals if one.any()), default=1.0)


def _largest(residuals: Sequence[Array], intervals: Sequence[float], width: int) -> float:
    """Return the largest integral time [s] by bands of `width` frequencies, 0 where there is no such band.

    The frequencies are those of the shortest recording; longer ones have more to a band, and count the more.
    """
    lengths = np.array([len(one) for one in residuals])
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
    """Return the periodogram (samples // 2 + 1,), 1 on average of white noise of variance 1; 0 first."""
    return np.asarray(np.abs(np.fft.rfft(residual)) ** 2 / len(residual))


def white_noise(residual: Array) -> float:
    """Return the rms of the largest white noise that a residual (samples,) may have in it, in its unit.

    White noise is as dense in every band of the spectrum, so no denser than the least dense of `NOISE_BANDS`.
    """
    power = _power(residual)[1:]
    return float(
        min(float(band.mean()) for band in np.array_split(power, min(NOISE_BANDS, power.size))) ** 0.5
    )
