"""Samples of a posterior, with credible intervals of each fault without the assumption of normality."""

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
"""Two intervals differ if an end differs by more than this share of the longer interval and by more than this
difference."""


@dataclass(frozen=True, eq=False)
class Posterior:
    """Samples of the posterior of a recording.

    `samples` (n, d) are in estimator coordinates, `components` (n, 8) are normalised faults. `interval95` and
    `median` belong to each component; for a direction they may exceed 1, where the circle closes.
    `diagnostics` belong to a chain; they are None for independent samples.
    """

    samples: Array
    components: Array
    interval95: Mapping[str, tuple[float, float]]
    median: Mapping[str, float]
    diagnostics: McmcDiagnostics | None

    @classmethod
    def of(cls, space: ParameterSpace, samples: Array, diagnostics: McmcDiagnostics | None) -> Self:
        """Return the posterior from which the `samples` (n, d) of `space` are drawn."""
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
        """Return the components whose interval differs materially from that in `intervals`."""
        return tuple(
            name for name, interval in self.interval95.items() if _differ(name, interval, intervals[name])
        )

    def notes(self, intervals: Mapping[str, tuple[float, float]]) -> list[str]:
        """Return a line on convergence, and a line for each component with a different interval."""
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
        """Return whether `name` is the direction of an eccentricity whose interval includes 0."""
        return name == "eccentricity_phase" and self.interval95["eccentricity"][0] == 0

    def to_dict(self) -> dict[str, Any]:
        """Return the posterior in the output of `emaphm diagnose --posterior --json`."""
        faults = {
            name: {"median": self.median[name], "interval95": list(self.interval95[name])} for name in NAMES
        }
        convergence = {} if self.diagnostics is None else {"convergence": self.diagnostics.to_dict()}
        return {"faults": faults, "samples": len(self.samples), **convergence}


def _differ(name: str, first: tuple[float, float], second: tuple[float, float]) -> bool:
    """Return whether two intervals of component `name` differ materially."""
    difference = min(
        max(abs(first[0] - second[0] - turn), abs(first[1] - second[1] - turn)) for turn in whole_turns(name)
    )
    longer = max(first[1] - first[0], second[1] - second[0])
    return difference > max(MATERIAL_SHARE * longer, MATERIAL_DIFFERENCE)
