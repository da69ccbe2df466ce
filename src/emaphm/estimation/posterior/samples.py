"""What a recording leaves possible of each fault, as samples: intervals where nothing is normal."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from emaphm.actuator import NAMES
from emaphm.actuator.faults import whole_turns
from emaphm.arrays import Array
from emaphm.estimation.posterior.credible_intervals import shortest_arc, shortest_interval
from emaphm.estimation.posterior.mcmc_diagnostics import McmcDiagnostics
from emaphm.estimation.space.parameter_space import ParameterSpace

MATERIAL_SHARE, MATERIAL_DIFFERENCE = 0.25, 5e-3
"""Two intervals differ if an end moves by more than both: a share of the longer one, and a difference."""


@dataclass(frozen=True, eq=False)
class Posterior:
    """Samples of what a recording leaves possible.

    `samples` (n, d) are in estimator coordinates, `components` (n, 8) normalised faults. `interval95` and
    `median` are those of each component; a direction's may run past 1, where the circle closes. `diagnostics`
    are those of a chain; independent samples have none.
    """

    samples: Array
    components: Array
    interval95: Mapping[str, tuple[float, float]]
    median: Mapping[str, float]
    diagnostics: McmcDiagnostics | None

    @classmethod
    def of(cls, space: ParameterSpace, samples: Array, diagnostics: McmcDiagnostics | None) -> Self:
        """Return the posterior that `samples` (n, d) of `space` are drawn from."""
        components = space.faults(samples)
        intervals, medians = {}, {}
        for name, values in zip(NAMES, components.T, strict=True):
            if name in space.fixed:
                intervals[name], medians[name] = (0.0, 1.0), float(values[0])
            elif name == "eccentricity_phase":
                intervals[name], medians[name] = shortest_arc(values)
            else:
                power = 2 if name == "eccentricity" else 1
                intervals[name] = shortest_interval(values, power, space.limits(name))
                medians[name] = float(np.median(values))
        return cls(samples, components, intervals, medians, diagnostics)

    def differing(self, intervals: Mapping[str, tuple[float, float]]) -> tuple[str, ...]:
        """Return the components whose interval is materially another than in `intervals`."""
        return tuple(name for name, mine in self.interval95.items() if _differ(name, mine, intervals[name]))

    def notes(self, intervals: Mapping[str, tuple[float, float]]) -> list[str]:
        """Return a line on convergence, and one for each component that `intervals` say otherwise of."""
        lines = []
        if self.diagnostics is not None:
            state = str(self.diagnostics)
            lines = [
                f"Sampled posterior: {state}." if self.diagnostics.converged else f"The posterior {state}."
            ]
        for name in self.differing(intervals):
            (low, high), (least, most) = self.interval95[name], intervals[name]
            lines.append(
                f"{name}: credible interval {low:.4f} to {high:.4f} (median {self.median[name]:.4f}), "
                f"in the table {least:.4f} to {most:.4f}"
                + (", if there is an eccentricity at all." if self._directionless(name) else ".")
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
        convergence = {} if self.diagnostics is None else {"convergence": self.diagnostics.to_dict()}
        return {"faults": faults, "samples": len(self.samples), **convergence}


def _differ(name: str, one: tuple[float, float], other: tuple[float, float]) -> bool:
    moved = min(
        max(abs(one[0] - other[0] - turn), abs(one[1] - other[1] - turn)) for turn in whole_turns(name)
    )
    longer = max(one[1] - one[0], other[1] - other[0])
    return moved > max(MATERIAL_SHARE * longer, MATERIAL_DIFFERENCE)
