"""First passage time of a margin with a Wiener process through 0."""

import numpy as np

from emaphm.arrays import Array


def first_passage(
    hours: Array,
    margin: Array,
    noise: Array,
    random: np.random.Generator,
    since: Array | float = 0.0,
    ahead: float = 0.0,
) -> Array:
    """Return the first passage times of n margins through 0 [h], shape (n,); `inf` without a passage.

    Between two times the margin is a Brownian bridge. From m_0 to m_1, both above 0, in h hours it touches 0
    with probability exp(-2 m_0 m_1 / (q² h)); if it does, the time t of the first passage has
    t / (h - t) ~ inverse Gaussian(m_0 / |m_1|, m_0² / (q² h)).

    Parameters
    ----------
    hours
        Increasing times [h], shape (m,), the first 0.
    margin
        Margins at these times, (m, n). If a margin starts at 0 or less, its first passage is at 0 h.
    noise
        q, standard deviation of the margin's Wiener process in each step [1/√h], (m - 1, n).
    since, ahead
        First passage times (n,) [h] of the margins through `ahead`, known from a tighter limit of the same
        level; the path is continued from there to 0.

    References
    ----------
    [1] Beghin, Orsingher: On the maximum of the generalized Brownian bridge, Lithuanian Mathematical Journal
        39 (1999). Folks, Chhikara: The inverse Gaussian distribution, Journal of the Royal Statistical
        Society B 40 (1978).
    """
    n = margin.shape[1]
    since = np.broadcast_to(since, n)
    passed = np.where(margin[0] <= 0, 0.0, np.inf)
    for i in range(hours.size - 1):
        is_within = (since > hours[i]) & (since < hours[i + 1])
        begin = np.where(is_within, since, hours[i])
        start, end, length = np.where(is_within, ahead, margin[i]), margin[i + 1], hours[i + 1] - begin
        variance = noise[i] ** 2 * length
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            touches = np.where(end <= 0, 1.0, np.exp(-2 * start * end / variance))
        crosses = np.isinf(passed) & (random.random(n) < np.nan_to_num(touches)) & (since < hours[i + 1])
        if not crosses.any():
            continue
        a, b = start[crosses], np.maximum(np.abs(end[crosses]), 1e-12)
        smooth = np.maximum(variance[crosses], np.maximum(1e-12 * a**2, 1e-300))
        ratio = random.wald(np.maximum(a / b, 1e-300), np.maximum(a**2 / smooth, 1e-300))
        passed[crosses] = begin[crosses] + length[crosses] * ratio / (1 + ratio)
    return passed
