"""What a recording leaves possible of each fault, as samples: intervals where nothing is normal."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from emaphm.actuator import NAMES
from emaphm.arrays import Array
from emaphm.estimation.mcmc_diagnostics import Convergence
from emaphm.estimation.parameter_space import FaultSpace

HARDLY_LONGER = 0.02
"""An interval that begins at a bound may be longer by this, about the Monte Carlo error of a length."""

WHOLE = 0.9
"""An interval longer than this share of its scale, or of a turn, is told as all of it."""

MATERIAL, LEAST_DIFFERENCE = 0.25, 5e-3
"""Two intervals differ if an end moves by more than this share of the longer, and by more than that."""


@dataclass(frozen=True, eq=False)
class Posterior:
    """Samples of what a recording leaves possible.

    `samples` (n, d) are in estimator coordinates, `components` (n, 8) normalised faults. `interval95` and
    `median` are those of each component; a direction's may run past 1, where the circle closes.
    `evaluations` counts the simulations that it took.
    """

    samples: Array
    components: Array
    interval95: Mapping[str, tuple[float, float]]
    median: Mapping[str, float]
    convergence: Convergence
    evaluations: int

    @classmethod
    def of(cls, space: FaultSpace, samples: Array, convergence: Convergence, evaluations: int) -> Self:
        """Return the posterior that `samples` (n, d) of `space` are drawn from."""
        components = space.faults(samples)
        intervals, medians = {}, {}
        for name, values in zip(NAMES, components.T, strict=True):
            if name in space.fixed:
                intervals[name], medians[name] = (0.0, 1.0), float(values[0])
            elif name == "eccentricity_phase":
                intervals[name], medians[name] = arc(values)
            else:
                power = 2 if name == "eccentricity" else 1
                intervals[name], medians[name] = interval(values, power), float(np.median(values))
        return cls(samples, components, intervals, medians, convergence, evaluations)

    def differing(self, intervals: Mapping[str, tuple[float, float]]) -> tuple[str, ...]:
        """Return the components whose interval is materially another than in `intervals`."""
        return tuple(name for name, mine in self.interval95.items() if _differ(name, mine, intervals[name]))

    def notes(self, intervals: Mapping[str, tuple[float, float]]) -> list[str]:
        """Return a line on convergence, and one for each component that `intervals` say otherwise of."""
        state = str(self.convergence)
        lines = [f"Sampled posterior: {state}." if self.convergence.converged else f"The posterior {state}."]
        for name in self.differing(intervals):
            (low, high), (least, most) = self.interval95[name], intervals[name]
            lines.append(
                f"{name}: {low:.4f} to {high:.4f} sampled (median {self.median[name]:.4f}), "
                f"{least:.4f} to {most:.4f} as a normal estimate"
                + (", should there be an eccentricity at all." if self._directionless(name) else ".")
            )
        return lines

    def _directionless(self, name: str) -> bool:
        """Return whether `name` is the direction of an eccentricity that may well be none."""
        return name == "eccentricity_phase" and self.interval95["eccentricity"][0] == 0

    def to_dict(self) -> dict[str, Any]:
        """Return what `emaphm diagnose --posterior --json` prints of it."""
        faults = {
            name: {"median": self.median[name], "interval95": list(self.interval95[name])} for name in NAMES
        }
        return {"faults": faults, "samples": len(self.samples), "convergence": self.convergence.to_dict()}


def _differ(name: str, one: tuple[float, float], other: tuple[float, float]) -> bool:
    turns = (-1, 0, 1) if name == "eccentricity_phase" else (0,)
    moved = min(max(abs(one[0] - other[0] - turn), abs(one[1] - other[1] - turn)) for turn in turns)
    longer = max(one[1] - one[0], other[1] - other[0])
    return moved > max(MATERIAL * longer, LEAST_DIFFERENCE)


def interval(values: Array, power: int = 1) -> tuple[float, float]:
    """Return the shortest interval that holds 95 % of `values` (n,) in [0, 1].

    It is shortest in `values` to a power: in the eccentricity's square, in which its prior is even, so that
    0 is not left out merely because a disk has little area about its centre. One that begins or ends at
    a bound is taken where it is `HARDLY_LONGER`, and all of [0, 1] instead of more than `WHOLE`.
    """
    ordered = np.sort(values) ** power
    held = int(np.ceil(0.95 * ordered.size))
    lengths = ordered[held - 1 :] - ordered[: ordered.size - held + 1]
    first = int(np.argmin(lengths))
    if lengths[first] > WHOLE:
        return 0.0, 1.0
    ends = (float(ordered[first]), float(ordered[first + held - 1]))
    most = (1 + HARDLY_LONGER) * float(lengths[first])
    for at_bound in ((0.0, float(ordered[held - 1])), (float(ordered[-held]), 1.0)):
        if at_bound[1] - at_bound[0] <= most:
            ends, most = at_bound, at_bound[1] - at_bound[0]
    return ends[0] ** (1 / power), ends[1] ** (1 / power)


def arc(turns: Array) -> tuple[tuple[float, float], float]:
    """Return the shortest arc that holds 95 % of `turns` (n,) in [0, 1], and the median counted along it.

    It may run past 1; where it is longer than `WHOLE`, it is (0, 1).
    """
    ordered = np.sort(turns)
    held = int(np.ceil(0.95 * ordered.size))
    around = np.concatenate([ordered, ordered + 1])
    lengths = around[held - 1 : held - 1 + ordered.size] - ordered
    first = int(np.argmin(lengths))
    # What is left out lies opposite the arc's middle: there the circle is cut open.
    cut = ordered[first] + lengths[first] / 2 - 0.5
    median = float((cut + np.median((turns - cut) % 1)) % 1)
    if lengths[first] > WHOLE:
        return (0.0, 1.0), median
    low, high = float(ordered[first]), float(ordered[first] + lengths[first])
    return (low, high), median + (1.0 if median < low else 0.0)
