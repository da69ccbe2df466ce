"""Laws of degradation of synthetic units: progress of a component towards its limit.

They are independent of the code of the degradation filter. The filter does not have the laws "two-phase",
"logistic" and "gamma process".
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from emaphm.arrays import Array

Parameters = Mapping[str, float]
Draw = Callable[[Array, Parameters, np.random.Generator], Array]


@dataclass(frozen=True, eq=False)
class Growth:
    """A law: progress p of a component as a function of its ageing u, 0 when new and about 1 at u = 1.

    Parameters
    ----------
    ranges
        Ranges from which the parameters of a unit are drawn, uniformly.
    progress
        Function for p at increasing ageing u (m,), given the parameters and a generator of random numbers.
    known
        Whether the degradation filter has this law.
    chance
        Parameter that is not predictable before ageing has reached it: the time of a change.
    """

    ranges: Mapping[str, tuple[float, float]]
    progress: Draw
    known: bool = True
    chance: str | None = None

    def drawn(self, random: np.random.Generator) -> dict[str, float]:
        """Return the parameters of a unit."""
        return {name: float(random.uniform(*ends)) for name, ends in self.ranges.items()}

    def still_open(
        self, parameters: Parameters, ageing: float, random: np.random.Generator
    ) -> dict[str, float]:
        """Return the parameters, with a `chance` parameter above this `ageing` drawn anew."""
        if self.chance is None or ageing >= parameters[self.chance]:
            return dict(parameters)
        low, high = self.ranges[self.chance]
        return {**parameters, self.chance: float(random.uniform(max(low, ageing), high))}


def _linear(u: Array, _: Parameters, __: np.random.Generator) -> Array:
    """Return p = u."""
    return u


def _exponential(u: Array, p: Parameters, _: np.random.Generator) -> Array:
    """Return p = (exp(k u) - 1) / (exp(k) - 1)."""
    return np.asarray(np.expm1(p["growth"] * u) / np.expm1(p["growth"]))


def _power(u: Array, p: Parameters, _: np.random.Generator) -> Array:
    """Return p = u^e."""
    return np.asarray(u ** p["exponent"])


def _onset(u: Array, p: Parameters, _: np.random.Generator) -> Array:
    """Return p = s (u - u_0), where u_0 is the time of the onset; 0 before."""
    return np.asarray(p["slope"] * np.maximum(u - p["moment"], 0.0))


def _two_phase(u: Array, p: Parameters, _: np.random.Generator) -> Array:
    """Return p = s u, and after the change point s u_0 + f s (u - u_0)."""
    return np.asarray(
        p["slope"] * (u + (p["factor"] - 1) * np.maximum(u - p["moment"], 0.0)),
    )


def _logistic(u: Array, p: Parameters, _: np.random.Generator) -> Array:
    """Return p = (σ((u - m) / w) - σ(-m / w)) / (σ((1 - m) / w) - σ(-m / w)), which saturates."""

    def sigma(x: Array | float) -> Array:
        return np.asarray(1 / (1 + np.exp(-(np.asarray(x) - p["middle"]) / p["width"])))

    return np.asarray((sigma(u) - sigma(0.0)) / (sigma(1.0) - sigma(0.0)))


def _gamma(u: Array, p: Parameters, random: np.random.Generator) -> Array:
    """Return a gamma process: independent increments with mean Δu and variance Δu / n, n jumps per life.

    Van Noortwijk: A survey of the application of gamma processes in maintenance, Reliability Engineering and
    System Safety 94 (2009).
    """
    steps = np.diff(u, prepend=0.0)
    n = p["jumps"]
    # A shape of 0 means an increment of 0.
    return np.cumsum(np.where(steps > 0, random.gamma(np.maximum(n * steps, 1e-12)) / n, 0.0))


LAWS: Mapping[str, Growth] = MappingProxyType(
    {
        "linear": Growth({}, _linear),
        "exponential": Growth({"growth": (1.0, 3.0)}, _exponential),
        "power law": Growth({"exponent": (0.6, 2.2)}, _power),
        "sudden onset": Growth({"moment": (0.2, 0.7), "slope": (1.4, 2.4)}, _onset, chance="moment"),
        "two-phase": Growth(
            {"moment": (0.3, 0.8), "slope": (0.4, 0.6), "factor": (2.5, 4.0)},
            _two_phase,
            known=False,
            chance="moment",
        ),
        "logistic": Growth({"middle": (0.4, 0.7), "width": (0.12, 0.25)}, _logistic, known=False),
        "gamma process": Growth({"jumps": (30.0, 80.0)}, _gamma, known=False),
    }
)
