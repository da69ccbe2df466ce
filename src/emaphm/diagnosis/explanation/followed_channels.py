"""Check of channels with an estimated scale and zero: whether they follow their quantity at all.

With a scale factor of 0 and the mean of the channel as its zero, any noise has an acceptable residual: rows
in another order, another channel, or the current of another manoeuvre.
"""

from collections.abc import Iterator, Sequence

from emaphm.arrays import Array
from emaphm.estimation.search_result import SearchResult

CERTAIN = 4.0
"""Smallest excess of the explained sum of squares over that of a fit to noise, in standard deviations."""


def unfollowed(result: SearchResult, channels: Sequence[str]) -> Iterator[str]:
    """Yield a sentence on each of the scaled `channels` of which the model explains no more than of noise.

    The sentence gives the explained share of the variance, because a sensor's zero explains no motion.
    """
    problem = result.objective.problem
    for name in channels:
        recorded = problem.compared(name, problem.measured[name])
        residual = problem.compared(name, result.residual_by_channel[name])
        if not is_followed(recorded, residual, result.objective.space.dimensions):
            yield (
                f"{name} does not follow its quantity: whatever its scale, the model explains "
                f"{100 * max(explained_share(recorded, residual), 0.0):.2g} % of its variation, no more than "
                "of noise; it may be noise, another channel, or from another manoeuvre"
            )


def explained_share(recorded: Array, residual: Array) -> float:
    """Return the share that a model explains of the `recorded` variance (samples,), from its `residual`."""
    return float(1 - residual.var() / recorded.var()) if recorded.var() > 0 else 0.0


def is_followed(recorded: Array, residual: Array, parameters: int) -> bool:
    """Return whether a fit of `parameters` parameters explains more of `recorded` (samples,) than of noise.

    Of white noise with variance σ², d parameters explain at most σ² times a chi-squared variable with d
    degrees of freedom: d σ² on average, with a standard deviation of √(2 d) σ². σ² is that of the residual.
    """
    explained = recorded.size * float(recorded.var() - residual.var())
    noise = parameters + CERTAIN * (2 * parameters) ** 0.5
    return bool(explained > noise * float(residual.var()))
