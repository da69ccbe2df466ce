"""Precision of each fault with an excitation, predicted from Fisher's information."""

from dataclasses import dataclass, replace

import numpy as np

from emaphm.arrays import Array
from emaphm.diagnosis.verdict import VERDICT, Z95, estimates
from emaphm.estimation.correction_iterations import BIAS_CORRECTION
from emaphm.estimation.discrepancy import REFERENCE_RUNS, RUN_SEPARATION, has_reference, reference_problem
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.search_result import default_scatter
from emaphm.estimation.space.parameter_space import ParameterSpace
from emaphm.estimation.uncertainty.local_covariance import jacobians_at, local_covariance
from emaphm.experiment.excitation import Excitation
from emaphm.experiment.test_setup import TestSetup
from emaphm.random_streams import stream


@dataclass(frozen=True, eq=False)
class Precision:
    """Half-widths of the 95 % intervals by component, medians over representative fault vectors.

    `half_widths` has no entry for components that the actuator lacks. The half-width of the phase is the
    median over the vectors with an eccentricity. `logarithms`, (vectors,), are the means over the faults'
    coordinates of the logarithm of the half-width, so that all components have the same weight.
    """

    half_widths: dict[str, float]
    logarithms: Array

    @classmethod
    def of(cls, space: ParameterSpace, points: Array, covariances: Array) -> "Precision":
        """Return the precision of estimates at `points` (n, d) with `covariances` (n, d, d)."""
        faults = len(space.columns)
        by_vector = [estimates(space, p, c) for p, c in zip(points, covariances, strict=True)]
        eccentric = [components for components in by_vector if components["eccentricity"].value > 0]
        halves = {
            name: Z95 * float(np.median([components[name].standard_error for components in chosen]))
            for name in by_vector[0]
            if name not in space.fixed
            and (chosen := eccentric if name == "eccentricity_phase" else by_vector)
        }
        errors = np.sqrt(np.einsum("nii->ni", covariances)[:, :faults])
        return cls(halves, np.log(Z95 * errors).mean(axis=1))

    def identifies(self, name: str) -> bool:
        """Return whether component `name` is identifiable."""
        return 2 * self.half_widths.get(name, np.inf) <= VERDICT.longest_interval


def predicted_precision(setup: TestSetup, excitation: Excitation, faults: Array, seed: int) -> Precision:
    """Return the expected precision of a recording of `excitation` under each of `faults` (n, 8).

    The covariance is that of a diagnosis with a residual of sensor noise and switching: the difference of one
    run of the reference model from the mean of the runs that correct the estimate. The same seed gives the
    same noise, row by row, and the same Jacobian points for every excitation, so that excitations can be
    compared.
    """
    objective = setup.objective(excitation)
    points = objective.space.points(faults)
    residuals = _switching_residuals(objective, points)
    covariances = []
    for i, (point, switching) in enumerate(zip(points, residuals, strict=True)):
        residual = switching + _noise(objective, setup.noise, seed, i)
        weighted = objective.reweighted(residual)
        residual = weighted.rescaled(residual, objective)[: objective.channel_rows]
        jacobians = jacobians_at(weighted, point, stream(seed, "Jacobians of the prediction"))
        covariances.append(local_covariance(weighted, point, residual, jacobians).covariance)
    return Precision.of(objective.space, points, np.array(covariances) + default_scatter(points.shape[1]))


def _noise(objective: MapObjective, noise: float, seed: int, vector: int) -> Array:
    """Return noise of the rms `noise` [A] on each weighted channel, and 0 on the nuisances, (rows,)."""
    samples, channels = objective.problem.samples, len(objective.problem.channels)
    drawn = [
        stream(seed, "noise of the prediction", vector, i).normal(0.0, noise, samples)
        for i in range(channels)
    ]
    return np.concatenate([*drawn, np.zeros(len(objective.space.nuisances.names))])


def _switching_residuals(objective: MapObjective, points: Array) -> Array:
    """Return the residual by switching after a correction at each of `points` (n, d), (n, rows)."""
    if not has_reference(objective.problem):
        return np.zeros((len(points), objective.target.size))
    reference = replace(objective, problem=reference_problem(objective))
    near = objective.space.project(points + RUN_SEPARATION)
    runs = reference.outputs(np.concatenate([points, near]))
    # The variance of one run less the mean of n runs is (1 + 1/n) times that of one run; that of a difference
    # of two runs is twice that of one run.
    repeats = REFERENCE_RUNS // len(BIAS_CORRECTION.step_shares)
    factor = ((1 + 1 / repeats) / 2) ** 0.5
    return np.asarray((runs[: len(points)] - runs[len(points) :]) * factor)
