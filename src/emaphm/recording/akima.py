"""Akima's piecewise cubic interpolation of equally spaced points, which does not overshoot next to a jump.

SciPy has this interpolation also, but its import takes 0.1 s, a large part of the time of a diagnosis from
the command line.
"""

from dataclasses import dataclass

import numpy as np

from emaphm.arrays import Array

FLAT = 1e-9
"""Changes of slope below this share of the largest change count as 0."""

CHUNK = 8192
"""Number of times evaluated at once: their arrays fit into the processor's cache, which halves the time."""


@dataclass(frozen=True, eq=False)
class AkimaCurve:
    """Cubic pieces c₀ + c₁ u + c₂ u² + c₃ u³, u = (t - start) / interval - i in [0, 1] on piece i.

    `coefficients` have shape (4, pieces). The first and last piece extrapolate beyond the points.
    """

    start: float
    interval: float
    coefficients: Array

    @classmethod
    def through(cls, values: Array, start: float, interval: float) -> "AkimaCurve":
        """Return the curve through `values` (n,), n at least 3, at the times start + i interval.

        The slope at a point is the weighted mean of the slopes of the chords to its left and right. The
        weight of the left chord is the change of the chords' slope on the right side, and vice versa. Beyond
        both ends the chords are extrapolated as those of a parabola.

        References
        ----------
        [1] H. Akima, A new method of interpolation and smooth curve fitting based on local procedures,
        Journal of the ACM 17 (1970).
        """
        chords = np.empty(values.size + 3)
        chords[2:-2] = np.diff(values)
        chords[1] = 2 * chords[2] - chords[3]
        chords[0] = 2 * chords[1] - chords[2]
        chords[-2] = 2 * chords[-3] - chords[-4]
        chords[-1] = 2 * chords[-2] - chords[-3]
        bends = np.abs(np.diff(chords))
        left, right = bends[:-2], bends[2:]
        total = left + right
        slopes = 0.5 * (chords[3:] + chords[:-3])
        bent = total > FLAT * total.max()
        share = left[bent] / total[bent]
        slopes[bent] = (1 - share) * chords[1:-2][bent] + share * chords[2:-1][bent]
        before, after, chord = slopes[:-1], slopes[1:], chords[2:-2]
        return cls(
            start,
            interval,
            np.array([values[:-1], before, 3 * chord - 2 * before - after, before + after - 2 * chord]),
        )

    def __call__(self, times: Array) -> Array:
        """Return the curve's values at `times`, shape (n,)."""
        values = np.empty(times.shape)
        for first in range(0, times.size, CHUNK):
            values[first : first + CHUNK] = self._values(times[first : first + CHUNK])
        return values

    def _values(self, times: Array) -> Array:
        u = times - self.start
        u *= 1 / self.interval
        piece = np.clip(u.astype(np.intp), 0, self.coefficients.shape[1] - 1)
        u -= piece
        c0, c1, c2, c3 = self.coefficients
        values = c3.take(piece)
        for lower in (c2, c1, c0):
            values *= u
            values += lower.take(piece)
        return np.asarray(values)
