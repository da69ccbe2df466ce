"""The precision of each fault that an excitation will give, predicted from Fisher's information."""

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
    """Half-widths of the 95 % intervals by component, the median over representative faults.

    `half_widths` lacks what the actuator cannot show. That of the phase is the median over the vectors that
    have an eccentricity. `logarithms`, (vectors,), are the means over the faults' coordinates of the
    logarithm of the half-width: a halved width is worth the same in any of them.
    """

    half_widths: dict[str, float]
    logarithms: Array

    @classmethod
    def of(cls, space: ParameterSpace, points: Array, covariances: Array) -> "Precision":
        """Return the precision of estimates at `points` (n, d) with `covariances` (n, d, d)."""
        faults = len(space.columns)
        each = [estimates(space, p, c) for p, c in zip(points, covariances, strict=True)]
        eccentric = [one for one in each if one["eccentricity"].value > 0]
        halves = {
            name: Z95 * float(np.median([one[name].standard_error for one in chosen]))
            for name in each[0]
            if name not in space.fixed and (chosen := eccentric if name == "eccentricity_phase" else each)
        }
        errors = np.sqrt(np.einsum("nii->ni", covariances)[:, :faults])
        return cls(halves, np.log(Z95 * errors).mean(axis=1))

    def identifies(self, name: str) -> bool:
        """Return whether component `name` is identifiable."""
        return 2 * self.half_widths.get(name, np.inf) <= VERDICT.longest_interval


def predicted_precision(setup: TestSetup, excitation: Excitation, faults: Array, seed: int) -> Precision:
    """Return the precision that a recording of `excitation` will give under each of `faults` (n, 8).

    The covariance is that of a diagnosis, for a residual of sensor noise and of what one run of the reference
    model differs from the mean of those that correct it. The same seed draws the same noise, row by row,
    and the same Jacobian points for every excitation, so that two of them can be compared.
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
    """Return noise of that rms [A] on each weighted channel, and none on the nuisances, (rows,)."""
    samples, channels = objective.problem.samples, len(objective.problem.channels)
    drawn = [
        stream(seed, "noise of the prediction", vector, i).normal(0.0, noise, samples)
        for i in range(channels)
    ]
    return np.concatenate([*drawn, np.zeros(len(objective.space.nuisances.names))])


def _switching_residuals(objective: MapObjective, points: Array) -> Array:
    """Return the residual that switching leaves after a correction at each of `points` (n, d), (n, rows)."""
    if not has_reference(objective.problem):
        return np.zeros((len(points), objective.target.size))
    reference = replace(objective, problem=reference_problem(objective))
    near = objective.space.project(points + RUN_SEPARATION)
    runs = reference.outputs(np.concatenate([points, near]))
    # The variance of one run less the mean of several is (1 + 1/n) times that of one, that of two runs twice.
    repeats = REFERENCE_RUNS // len(BIAS_CORRECTION.step_shares)
    factor = ((1 + 1 / repeats) / 2) ** 0.5
    return np.asarray((runs[: len(points)] - runs[len(points) :]) * factor)
