"""Joint fit of a healthy unit's parameters to all recordings, with their uncertainty."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from emaphm.actuator import Actuator
from emaphm.arrays import Array
from emaphm.calibration.campaign import CampaignRow
from emaphm.calibration.conditions import common_factor, joint_objective, only_ratios
from emaphm.calibration.lack_of_fit import LackOfFit, lack_of_fit
from emaphm.calibration.motion.fit import measured_start
from emaphm.estimation.joint.contradictions import Contradictions, contradictions_of_most
from emaphm.estimation.joint.correction import JointEstimate, corrected_estimate
from emaphm.estimation.joint.objective import JointObjective
from emaphm.estimation.joint.search import search
from emaphm.estimation.joint.uncertainty import JointUncertainty, joint_uncertainty
from emaphm.estimation.space.parameter_variation import WIDEST_FACTOR, ParameterVariation
from emaphm.progress import Progress, subprogress

AT_BOUND = 0.98
"""Fraction of the distance to its bound above which a parameter is at its bound: descents stop before it."""

NO_START: Mapping[str, float] = MappingProxyType({})


@dataclass(frozen=True, eq=False)
class FitSettings:
    """Settings of all fits of a calibration; see `emaphm.calibration.calibrate`.

    `every_row` is that of `joint_objective`. `known` are prior standard deviations of parameters (by the
    logarithm), for example from tolerances.
    """

    nuisances: Sequence[str] | None
    max_corrections: int
    seed: int
    workers: int | None
    every_row: bool = False
    known: Mapping[str, float] = field(default_factory=dict)

    @property
    def unknown_constant(self) -> float:
        """Standard deviation, by the logarithm, of a torque constant that is not identifiable."""
        return self.known.get("torque_constant", math.log(WIDEST_FACTOR))

    def variation(self, actuator: Actuator, names: tuple[str, ...]) -> ParameterVariation:
        """Return the variation of the parameters `names`, one coordinate each."""
        return ParameterVariation.free(actuator, names).known_to(self.known)

    def objective(
        self, rows: Sequence[CampaignRow], actuator: Actuator, unit: ParameterVariation
    ) -> JointObjective:
        """Return the joint objective of all `rows` in the `unit`'s parameters."""
        return joint_objective(rows, actuator, unit, self.nuisances, self.workers, every_row=self.every_row)


@dataclass(frozen=True, eq=False)
class UnitFit:
    """Result of a joint fit of the parameters `free`.

    Attributes
    ----------
    deviations, covariance
        Deviations of the parameters from the description, in their coordinates, (p,), and their covariance
        (p, p). If the recordings scatter, the covariance is that of the parameters of a next recording.
    at_bound
        Whether each parameter is at the bound of the search, (p,).
    contradictions
        Contradictions between the recordings; None for one recording.
    fitted
        Parameters with coordinates in the fit: all, except the torque constant if only ratios are known.
    lacks
        Lack of fit of each recording; the covariance includes its effect.
    """

    free: tuple[str, ...]
    fitted: tuple[str, ...]
    deviations: Array
    covariance: Array
    at_bound: NDArray[np.bool_]
    estimate: JointEstimate
    uncertainty: JointUncertainty
    contradictions: Contradictions | None
    lacks: tuple[LackOfFit, ...]

    @property
    def joint(self) -> JointObjective:
        """Joint objective at the end of the fit."""
        return self.estimate.joint

    @property
    def point(self) -> Array:
        """Estimate in the coordinates of `joint`, (d,)."""
        return self.uncertainty.point

    def contradicts(self, name: str) -> bool:
        """Return whether the recordings contradict each other in a parameter by more than their errors."""
        if self.contradictions is None or name not in self.fitted:
            return False
        return bool(self.contradictions.contradicted[self.fitted.index(name)])

    @property
    def standard_errors(self) -> Array:
        """Standard errors of the deviations, (p,)."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))


@dataclass(frozen=True, eq=False)
class SearchedUnit:
    """Result of a search without correction: the objective, and its end `point` (d,)."""

    joint: JointObjective
    point: Array

    @property
    def start(self) -> dict[str, float]:
        """Shared coordinates by parameter."""
        names = self.joint.unit.parameters
        return dict(zip(names, self.point[: len(names)].tolist(), strict=True))


def searched(
    rows: Sequence[CampaignRow],
    actuator: Actuator,
    fitted: tuple[str, ...],
    settings: FitSettings,
    start: Mapping[str, float] = NO_START,
    on_progress: Progress | None = None,
) -> SearchedUnit:
    """Return the end of the search for the parameters `fitted`.

    Its starts include `start`, and the estimates of inverse dynamics from the measured motion.
    """
    joint = settings.objective(rows, actuator, settings.variation(actuator, fitted))
    starts = (start, measured_start(rows, actuator, fitted, settings.nuisances))
    given = [np.array([values.get(name, 0.0) for name in fitted]) for values in starts if values]
    return SearchedUnit(*search(joint, settings.seed, given, on_progress))


def fitted_parameters(
    rows: Sequence[CampaignRow], actuator: Actuator, free: tuple[str, ...]
) -> tuple[str, ...]:
    """Return the `free` parameters that have coordinates in a fit to `rows`."""
    if only_ratios(rows, actuator, free):
        return tuple(name for name in free if name != "torque_constant")
    return free


def fit_unit(
    rows: Sequence[CampaignRow],
    actuator: Actuator,
    free: tuple[str, ...],
    settings: FitSettings,
    start: Mapping[str, float] = NO_START,
    on_progress: Progress | None = None,
    starts: Sequence[SearchedUnit] = (),
) -> UnitFit:
    """Return the joint fit of `free` to all `rows`; parameters and raised errors are those of `calibrate`.

    `start` are start coordinates by parameter, in addition to the description. Each of `starts` is corrected
    like the end of a search, and the best result is used.
    """
    fitted = fitted_parameters(rows, actuator, free)
    end = searched(rows, actuator, fitted, settings, start, subprogress(on_progress, 0.0, 1 / 3))
    correcting = subprogress(on_progress, 1 / 3, 0.9)
    estimates = [
        corrected_estimate(unit.joint, unit.point, settings.max_corrections, settings.seed, correcting)
        for unit in (end, *starts)
    ]
    estimate = min(estimates, key=lambda corrected: corrected.primary_variance)
    unit = end.joint.unit
    open_scales = [only_ratios([row], actuator, fitted) for row in rows]

    def unresolved(r: int, point: Array) -> Array:
        described = estimate.joint.terms[r].objective.problem.actuator
        scale = settings.unknown_constant * common_factor(described, unit.parameters, point)
        return open_scales[r] * np.outer(scale, scale)

    lacks = lack_of_fit(estimate)

    def hidden(r: int, jacobian: Array) -> Array | float:
        return lacks[r].scores(jacobian) if lacks[r].has_any else 0.0

    uncertainty = joint_uncertainty(estimate, settings.seed, unresolved, hidden=hidden)
    alone = uncertainty.alone
    contradicted = None if alone is None else contradictions_of_most(alone, unit.priors)
    deviations, at_bound = uncertainty.point[: len(fitted)], _at_bound(uncertainty.point, unit)
    covariance = uncertainty.covariance[: len(fitted), : len(fitted)]
    if contradicted is not None:
        covariance = covariance + contradicted.covariance
    # The true value of a parameter at its bound may be anywhere beyond it.
    covariance = covariance + np.diag(np.where(at_bound, unit.widest, 0.0) ** 2)
    covariance = within_range(covariance, unit.widest)
    chosen = np.array([[float(name == other) for other in fitted] for name in free]).reshape(len(free), -1)
    full = chosen @ deviations
    # The torque constant was not fitted if the recordings have information only on ratios to it.
    unknown = 0.0 if fitted == free else settings.unknown_constant
    scale = unknown * common_factor(actuator, free, full)
    return UnitFit(
        free=free,
        fitted=fitted,
        deviations=full,
        covariance=chosen @ covariance @ chosen.T + np.outer(scale, scale),
        at_bound=chosen @ at_bound > 0,
        estimate=estimate,
        uncertainty=uncertainty,
        contradictions=contradicted,
        lacks=lacks,
    )


def within_range(covariance: Array, widest: Array) -> Array:
    """Return a `covariance` (p, p) with standard deviations of at most `widest` (p,), the search range.

    Correlations are kept. The scatter of recordings that contradict each other along what they hardly
    determine may be far larger than that range, which no estimate leaves.
    """
    deviations = np.sqrt(np.diag(covariance))
    shares = np.minimum(1.0, widest / np.maximum(deviations, np.finfo(float).tiny))
    return np.asarray(np.outer(shares, shares) * covariance)


def _at_bound(point: Array, unit: ParameterVariation) -> NDArray[np.bool_]:
    return np.abs(point[: unit.widest.size]) >= AT_BOUND * unit.widest
