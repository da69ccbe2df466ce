"""Channels that do not follow their quantity, though another scale and zero of the sensor take up the rest.

With a factor of 0 on the modelled signal and the mean of the recorded one as the zero, any noise leaves a
residual of noise alone: rows in another order, another channel, or the current of another manoeuvre.
"""

from collections.abc import Iterator, Sequence

from emaphm.arrays import Array
from emaphm.estimation.search_result import SearchResult

CERTAIN = 4.0
"""Standard deviations by which the explained sum of squares exceeds what the parameters take up of noise."""


def unfollowed(result: SearchResult, channels: Sequence[str]) -> Iterator[str]:
    """Yield a sentence on each of the `channels`, scaled ones, of which the model explains nothing for sure.

    The share of the variation about the mean is named: the zero of a sensor explains no motion.
    """
    problem = result.objective.problem
    for name in channels:
        recorded = problem.compared(name, problem.measured[name])
        residual = problem.compared(name, result.residual_by_channel[name])
        if not is_followed(recorded, residual, result.objective.space.dimensions):
            yield (
                f"{name} does not follow its quantity: whatever its scale, the model explains "
                f"{100 * max(explained_share(recorded, residual), 0.0):.2g} % of its variation, no more than "
                "of noise; it may be noise, another channel, or of another manoeuvre"
            )


def explained_share(recorded: Array, residual: Array) -> float:
    """Return the share that a model explains of the `recorded` variance (samples,), from its `residual`."""
    return float(1 - residual.var() / recorded.var()) if recorded.var() > 0 else 0.0


def is_followed(recorded: Array, residual: Array, parameters: int) -> bool:
    """Return whether a fit of this many `parameters` explains more of `recorded` (samples,) than of noise.

    Of white noise of variance σ², d parameters take up σ² times chi-squared of d degrees of freedom at most:
    d σ² on average, with a standard deviation of √(2 d) σ². The residual's variance is taken for σ².
    """
    explained = recorded.size * float(recorded.var() - residual.var())
    noise = parameters + CERTAIN * (2 * parameters) ** 0.5
    return bool(explained > noise * float(residual.var()))
