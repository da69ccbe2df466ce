"""Likelihood ratio test of each degraded component: whether the recording is explained without the fault.

The covariance at an estimate is that of a linear model. If a manoeuvre has little information, for example of
an actuator that moves in one direction only, the optimum lies in a flat valley with kinks: the search may end
away from it, and derivatives across kinks give too small a covariance. The fit is therefore repeated with the
component healthy, as in a likelihood ratio test (Wilks 1938), and compared by the reference model. It is not
repeated if the residual of the linear model without the fault is far too large.
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
    """Limits of the test.

    A fault is not needed if the sum of squared residuals without it is larger by less than `chi_square` times
    the product of the variance of a row and the number of rows over which the residual is correlated. With a
    probability of 1 in 20, any of seven components exceeds this by chance. Of 40 faults of 5 % on the rig of
    the documentation, all except those of the gain were needed. A refit is not tried if the residual of the
    linear model is more than `hopeless` times as large.
    """

    chi_square: float = 7.24
    hopeless: float = 3.0


WITHOUT_FAULT = WithoutFaultSettings()


def tested_by_refits(
    components: Mapping[str, Estimate], result: SearchResult, jacobians: Array, seed: int
) -> dict[str, Estimate]:
    """Return the `components` of `result`; a degraded component that is not needed is undecided.

    The test is made if the reference model has corrected the estimate. `jacobians` (n, d, channel rows) are
    those of the channels at the estimate. In slow motions the intervals of all components include their
    values without a fault that is not needed: the valley of equally good estimates is long there, and the
    linear model does not contain its length.
    """
    checked = dict(components)
    if not result.correction.any():
        return checked
    linear = _NormalEquations.at(result, jacobians)
    slow = moves_slowly(result.objective.problem)
    largest_share, with_fault = _largest_equal_share(result, slow=slow), None
    for name, component in components.items():
        if component.verdict != "degraded" or name == "eccentricity_phase":
            continue
        linear_share, step = linear.without(name)
        if linear_share > WITHOUT_FAULT.hopeless:
            continue
        with_fault = with_fault or Refit.under(result.objective, result.point[np.newaxis], result)
        refit = _refit_without(name, result, result.point + step, with_fault, seed)
        share = refit.misfit / with_fault.misfit
        if share < largest_share:
            if slow:
                checked = _with_values_of(refit, checked, components, name)
            reason = f"the recording is explained equally well without it (squared residual × {share:.3g})"
            checked[name] = undecided(name, checked[name], reason)
    return with_phase_undecided(checked, components)


def _healthy(name: str) -> float:
    """Return the healthy value of a component."""
    return float(getattr(HEALTHY, name))


def _with_values_of(
    refit: Refit, checked: Mapping[str, Estimate], components: Mapping[str, Estimate], without: str
) -> dict[str, Estimate]:
    """Return the `checked` components with the values of a refit `without` a fault in their intervals."""
    faults = refit.objective.space.faults(refit.point)
    why = f"without a fault of {without.replace('_', ' ')}"
    return {
        name: with_other_value(name, component, components[name], float(value), why)
        for (name, component), value in zip(checked.items(), faults, strict=True)
    }


def _largest_equal_share(result: SearchResult, *, slow: bool) -> float:
    """Return the largest ratio of mean squared residuals with which an explanation is equally good.

    In slow motions, the correlation is that of the channel with the longest one: the error of a position is
    constant from one rest to the next.
    """
    correlated_rows = result.objective.correlated_rows
    if slow:
        correlated_rows = max(correlated_rows, longest_correlation(result.residual_by_channel.values()))
    return 1 + WITHOUT_FAULT.chi_square * correlated_rows / result.objective.compared_rows


def _coordinates_of(name: str) -> tuple[str, ...]:
    """Return the names of the coordinates of a component."""
    return ("eccentricity_x", "eccentricity_y") if name == "eccentricity" else (name,)


@dataclass(frozen=True, eq=False)
class _NormalEquations:
    """Normal equations of the linear model at `result`, with priors: matrix (d, d) and gradient (d,)."""

    result: SearchResult
    normal: Array
    gradient: Array

    @classmethod
    def at(cls, result: SearchResult, jacobians: Array) -> "_NormalEquations":
        """Return the normal equations from `jacobians` (n, d, channel rows)."""
        jacobian = np.concatenate([jacobians.mean(axis=0), result.objective.jacobian_of_priors], axis=1)
        return cls(result, jacobian @ jacobian.T, jacobian @ result.residual)

    def without(self, name: str) -> tuple[float, Array]:
        """Return the sum of squares without a fault, relative to that with it, and the step (d,) to it."""
        coordinates = self.result.objective.space.coordinates
        fixed = np.array([coordinates.index(coordinate) for coordinate in _coordinates_of(name)])
        free = np.delete(np.arange(self.gradient.size), fixed)
        step = np.zeros(self.gradient.size)
        step[fixed] = _healthy(name) - self.result.point[fixed]
        right_hand_side = self.gradient[free] - self.normal[np.ix_(free, fixed)] @ step[fixed]
        step[free] = np.linalg.lstsq(self.normal[np.ix_(free, free)], right_hand_side)[0]
        present = float(self.result.residual @ self.result.residual)
        increase = float(step @ self.normal @ step - 2 * step @ self.gradient)
        return 1 + increase / max(present, np.finfo(float).tiny), step


def _refit_without(name: str, result: SearchResult, start: Array, before: Refit, seed: int) -> Refit:
    """Return the refit with a component healthy, also from `start` (d,); `before` is that with the fault."""
    objective, free = _healthy_objective(name, result.objective)
    starts = objective.space.project(np.array([result.point, start])[:, free])
    return Refit.under(objective, starts, result).corrected(before, seed, f"a refit without {name}")


def _healthy_objective(name: str, objective: MapObjective) -> tuple[MapObjective, Array]:
    """Return the objective with a component healthy, and a mask (d,) of its remaining coordinates."""
    space = objective.space
    free = np.array([coordinate not in _coordinates_of(name) for coordinate in space.coordinates])
    columns = tuple(i for i in space.columns if CARTESIAN_NAMES[i] not in _coordinates_of(name))
    fixed = {**space.fixed, name: "it is taken as healthy"}
    smaller = replace(space, lower=space.lower[free], upper=space.upper[free], columns=columns, fixed=fixed)
    return replace(objective, space=smaller), free
