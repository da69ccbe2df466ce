"""How well a manoeuvre will identify each fault, told before the test from Fisher's information."""

from dataclasses import dataclass, replace

import numpy as np

from emaphm.arrays import Array
from emaphm.diagnosis.verdict import WIDEST_HALF_INTERVAL, Z95, estimates
from emaphm.estimation.bias_correction import APART, RUNS, SHARES, has_reference, resolution
from emaphm.estimation.local_covariance import neighbourhood, slopes
from emaphm.estimation.objective import Fit
from emaphm.estimation.parameter_space import FaultSpace
from emaphm.experiment.excitation import Manoeuvre
from emaphm.experiment.test_setup import Conditions
from emaphm.simulation import REFERENCE


@dataclass(frozen=True, eq=False)
class Widths:
    """Half-widths of the 95 % intervals by component, the median over representative faults.

    `half_widths` lacks what the actuator cannot show. That of the phase is the median over the vectors that
    have an eccentricity. `logarithms`, (vectors,), are the means over the faults' coordinates of the
    logarithm of the half-width: what is halved in any is worth the same.
    """

    half_widths: dict[str, float]
    logarithms: Array

    @classmethod
    def of(cls, space: FaultSpace, points: Array, covariances: Array) -> "Widths":
        """Return the widths of estimates at `points` (n, d) with `covariances` (n, d, d)."""
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

    def told(self, name: str) -> bool:
        """Return whether component `name` can be told."""
        return self.half_widths.get(name, np.inf) <= WIDEST_HALF_INTERVAL


def expected(conditions: Conditions, manoeuvre: Manoeuvre, faults: Array, seed: int) -> Widths:
    """Return how well a recording of `manoeuvre` will tell each of `faults` (n, 8).

    The covariance is a diagnosis's own, of a residual that holds noise and what one run of the reference
    model differs from the mean of those that correct it. The same seed draws the same noise, row by row,
    and the same points about each fault vector for every manoeuvre, so that two of them can be compared.
    """
    fit = conditions.fit(manoeuvre)
    points = fit.space.points(faults)
    residuals = _ripple(fit, points)
    covariances = []
    for i, (point, ripple) in enumerate(zip(points, residuals, strict=True)):
        residual = ripple + _noise(fit, conditions.noise, [seed, i])
        weighted = fit.reweighted(residual)
        residual = weighted.rescaled(residual, fit)[: fit.recorded_rows]
        derivatives, _ = slopes(weighted, point, seed)
        covariances.append(neighbourhood(weighted, point, residual, derivatives).covariance)
    return Widths.of(fit.space, points, np.array(covariances) + resolution(points.shape[1]))


def _noise(fit: Fit, noise: float, seed: list[int]) -> Array:
    """Return noise of that rms [A] on each weighted channel, and none on the nuisances, (rows,)."""
    samples, channels = fit.problem.recording.samples, len(fit.problem.channels)
    drawn = [np.random.default_rng([*seed, i]).normal(0.0, noise, samples) for i in range(channels)]
    return np.concatenate([*drawn, np.zeros(len(fit.space.nuisances.names))])


def _ripple(fit: Fit, points: Array) -> Array:
    """Return the chaos of switching that a correction leaves at each of `points` (n, d), (n, rows)."""
    if not has_reference(fit.problem):
        return np.zeros((len(points), fit.target.size))
    reference = replace(fit.problem.by(REFERENCE), start=fit.problem.start)
    beside = fit.space.project(points + APART)
    runs = fit.by(reference).outputs(np.concatenate([points, beside]))
    # One run less the mean of several is a little more than one alone; the difference of two is twice that.
    repeats = RUNS // len(SHARES)
    return np.asarray((runs[: len(points)] - runs[len(points) :]) * ((1 + 1 / repeats) / 2) ** 0.5)
