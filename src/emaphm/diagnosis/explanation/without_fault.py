"""Whether a recording is explained as well with a degraded component healthy: a test by refits.

The covariance at an estimate is that of a linear model there. Where a manoeuvre says little, of an actuator
that moves one way only for instance, the optimum lies in a flat valley with kinks: the search may end off it,
and derivatives across kinks claim more than is known. What counts is whether the recording can be explained
without the fault. So the fit is repeated with the component healthy, as in a likelihood ratio test
(Wilks 1938), and the reference model is asked where that leads. Where the linear model leaves no doubt,
nothing is repeated.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from emaphm.actuator.faults import CARTESIAN_NAMES, HEALTHY
from emaphm.arrays import Array
from emaphm.diagnosis.explanation.other_values import with_other_value
from emaphm.diagnosis.explanation.refits import Refit
from emaphm.diagnosis.verdict import Estimate, undecided, with_phase_undecided
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.uncertainty.correlation import longest_correlation
from emaphm.estimation.uncertainty.local_covariance import moves_slowly


@dataclass(frozen=True)
class WithoutFaultSettings:
    """When a fault is not needed to explain a recording.

    Without it, the sum of the squared residuals is larger by less than `chi_square` times the variance of a
    row, and the number of rows over which the residual is correlated: 1 in 20 that any of seven components
    exceeds that by chance. Of 40 faults of 5 % on the rig of the pages, all but those of the gain were needed
    by that measure. What the linear model leaves more than `hopeless` times is not tried.
    """

    chi_square: float = 7.24
    hopeless: float = 3.0


WITHOUT_FAULT = WithoutFaultSettings()


def tested_by_refits(
    components: Mapping[str, Estimate], result: SearchResult, jacobians: Array, seed: int
) -> dict[str, Estimate]:
    """Return the `components` of `result`, undecided where the recording is explained as well without them.

    Tried for each that is degraded, where the reference model has corrected the estimate. `jacobians`,
    (n, d, channel rows), are those of the channels there. On slow motions the intervals of all components
    include what they are without a fault that is not needed: there the valley of estimates that explain
    alike is long, and a linear model at one of them does not know its length.
    """
    checked = dict(components)
    if not result.correction.any():
        return checked
    linear = _NormalEquations.at(result, jacobians)
    slow = moves_slowly(result.objective.problem)
    most, before = _most_share(result, slow=slow), None
    for name, one in components.items():
        if one.verdict != "degraded" or name == "eccentricity_phase":
            continue
        left, step = linear.without(name)
        if left > WITHOUT_FAULT.hopeless:
            continue
        before = before or Refit.under(result.objective, result.point[np.newaxis], result)
        refit = _refit_without(name, result, result.point + step, before, seed)
        share = refit.misfit / before.misfit
        if share < most:
            if slow:
                checked = _with_values_of(refit, checked, components, name)
            reason = f"the recording is explained as well without it ({share:.3g} of the residual is left)"
            checked[name] = undecided(name, checked[name], reason)
    return with_phase_undecided(checked, components)


def _healthy(name: str) -> float:
    return float(getattr(HEALTHY, name))


def _with_values_of(
    refit: Refit, checked: Mapping[str, Estimate], components: Mapping[str, Estimate], without: str
) -> dict[str, Estimate]:
    """Return the `checked` components; their intervals include the values of a refit `without` a fault."""
    faults = refit.objective.space.faults(refit.point)
    why = f"without a fault of {without.replace('_', ' ')}"
    return {
        name: with_other_value(name, one, components[name], float(value), why)
        for (name, one), value in zip(checked.items(), faults, strict=True)
    }


def _most_share(result: SearchResult, *, slow: bool) -> float:
    """Return the share of the mean squared residual up to which an explanation is as good.

    Of slow motions, by the channel whose residual is correlated longest: a position is off by the same amount
    from one rest to the next.
    """
    together = result.objective.correlated_rows
    if slow:
        together = max(together, longest_correlation(result.residual_by_channel.values()))
    return 1 + WITHOUT_FAULT.chi_square * together / result.objective.compared_rows


def _coordinates_of(name: str) -> tuple[str, ...]:
    return ("eccentricity_x", "eccentricity_y") if name == "eccentricity" else (name,)


@dataclass(frozen=True, eq=False)
class _NormalEquations:
    """Of the linear model at the estimate of `result`, with priors: matrix (d, d) and gradient (d,)."""

    result: SearchResult
    normal: Array
    gradient: Array

    @classmethod
    def at(cls, result: SearchResult, jacobians: Array) -> "_NormalEquations":
        """Return the normal equations by `jacobians` (n, d, channel rows)."""
        jacobian = np.concatenate([jacobians.mean(axis=0), result.objective.jacobian_of_priors], axis=1)
        return cls(result, jacobian @ jacobian.T, jacobian @ result.residual)

    def without(self, name: str) -> tuple[float, Array]:
        """Return what is left without a fault, relative to with it, and the step (d,) that leads there."""
        coordinates = self.result.objective.space.coordinates
        fixed = np.array([coordinates.index(one) for one in _coordinates_of(name)])
        others = np.delete(np.arange(self.gradient.size), fixed)
        step = np.zeros(self.gradient.size)
        step[fixed] = _healthy(name) - self.result.point[fixed]
        asked = self.gradient[others] - self.normal[np.ix_(others, fixed)] @ step[fixed]
        step[others] = np.linalg.lstsq(self.normal[np.ix_(others, others)], asked)[0]
        present = float(self.result.residual @ self.result.residual)
        more = float(step @ self.normal @ step - 2 * step @ self.gradient)
        return 1 + more / max(present, np.finfo(float).tiny), step


def _refit_without(name: str, result: SearchResult, start: Array, before: Refit, seed: int) -> Refit:
    """Return the refit with a component healthy, from `start` (d,) too; `before` is that with the fault."""
    objective, kept = _healthy_objective(name, result.objective)
    starts = objective.space.project(np.array([result.point, start])[:, kept])
    return Refit.under(objective, starts, result).corrected(before, seed, f"a refit without {name}")


def _healthy_objective(name: str, objective: MapObjective) -> tuple[MapObjective, Array]:
    """Return the objective with a component healthy, and which coordinates (d,) it still has."""
    space = objective.space
    kept = np.array([one not in _coordinates_of(name) for one in space.coordinates])
    columns = tuple(i for i in space.columns if CARTESIAN_NAMES[i] not in _coordinates_of(name))
    fixed = {**space.fixed, name: "it is taken as healthy"}
    smaller = replace(space, lower=space.lower[kept], upper=space.upper[kept], columns=columns, fixed=fixed)
    return replace(objective, space=smaller), kept
