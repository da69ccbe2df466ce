"""Update of a network's answer by the averaged model: one Gauss-Newton step, corrected by a second network.

The training set of a network that reads rows alone has few actuators close to the given one. The averaged
model predicts the rows: it is run at the answer's mean θ₁ and, for each coordinate, one standard deviation
from it along the columns of F₁, Σ₁ = F₁ F₁ᵀ. With the residual r of the run at θ₁, and the differences J of
the other runs from it,

    z = B (r - m),   x = (1 + Jᵀ BᵀB J)⁻¹ Jᵀ Bᵀ z,   θ₂ = θ₁ + F₁ x,   Σ₂ = F₁ (1 + Jᵀ BᵀB J)⁻¹ F₁ᵀ:

least squares with the answer as the prior (Tarantola 2005, ch. 3). m is the mean, over the training set, of
the difference of the reference model from the averaged model, and B whitens the scatter of this difference:
rows in which the two models differ, mostly because of the switching, have a small weight.

The linear model is an approximation, and the discrepancy depends on the faults. A second network therefore
reads z, x, the information, θ₂ and the standard deviations, and returns the posterior as a mixture about θ₂,
in units of Σ₂ and a share of Σ₁. It is trained on the same draws as the first network, with other noise. The
first network's answers for these draws are somewhat better than for recordings; the temperature, from
held-out draws, compensates this (`emaphm.amortized.judging`).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np

from emaphm.amortized.error_prediction.deviations import deviation_directions, other_descriptions
from emaphm.amortized.networks.mixture import Mixture
from emaphm.amortized.networks.network import Network
from emaphm.amortized.networks.projection import in_units
from emaphm.amortized.parts import of_parts
from emaphm.amortized.recording_setup import RecordingSetup
from emaphm.amortized.simulating import TrainingSet, noise_rms, simulated
from emaphm.arrays import Array, Single
from emaphm.estimation.space.parameter_space import ParameterSpace
from emaphm.simulation import AVERAGED, Inputs


@dataclass(frozen=True)
class UpdateSettings:
    """Settings of the comparison of an answer with the averaged model.

    m and B are computed from at most `differing` draws. B has `components` rows, selected with at most
    `directions` answers. Residuals are limited to `largest_row` units in a row and to `largest` standard
    deviations in z; a step is limited to `longest` standard deviations of the answer. Differences are divided
    by the steps of the runs with a `ridge`: a run that a bound has limited carries little information.
    Units are at least `floor` times the answer's standard deviations: the error of the linear model limits
    the precision that a large J suggests. `at_once` answers are compared together, which takes 130 MB.
    """

    differing: int = 65_536
    components: int = 256
    directions: int = 2048
    largest_row: float = 30.0
    largest: float = 8.0
    longest: float = 3.0
    ridge: float = 1e-4
    floor: float = 0.2
    at_once: int = 64


UPDATE = UpdateSettings()


AVERAGED_AT_ONCE = 1024
"""Runs of the averaged model that are compared together with those of the reference model: 100 MB."""


@dataclass(frozen=True, eq=False)
class Whitening:
    """Whitening of the rows.

    `units` (channels,) of the rows, and m (rows,) and Bᵀ (rows, k) in these units, all channels concatenated.
    """

    units: Array
    mean: Single
    basis: Single

    def z(self, rows: Single, runs: "_Runs") -> tuple[Array, Array]:
        """Return z (n, k) of rows (n, channels, blocks), and B times the runs' differences, (n, d, k)."""
        whitened = self.whitened(np.concatenate([rows, runs.rows]))
        recorded = whitened[: len(rows)]
        modelled = whitened[len(rows) :].reshape(len(rows), -1, whitened.shape[1])
        residual = recorded - modelled[:, 0] - self.whitened_mean
        return residual.astype(float), (modelled[:, 1:] - modelled[:, :1]).astype(float)

    def whitened(self, rows: Single) -> Single:
        """Return B times rows (n, channels, blocks), (n, k)."""
        return np.asarray(in_units(rows, self.units) @ self.basis)

    @cached_property
    def whitened_mean(self) -> Single:
        """B m, (k,)."""
        return np.asarray(self.mean @ self.basis)

    @classmethod
    def of(
        cls,
        setup: RecordingSetup,
        inputs: Inputs,
        draws: TrainingSet,
        rows: Single,
        answers: Sequence[Mixture],
        units: Array,
    ) -> Self:
        """Return the whitening of noise, and of the difference of noise-free `draws` from the averaged model.

        It keeps the directions in which the averaged model varies most about `answers` for `rows`, and in
        which errors of sensors and of the description change the rows most.
        """
        mean, covariance = _discrepancy_moments(setup, inputs, draws, units)
        variances, directions = np.linalg.eigh(covariance)
        least = np.finfo(np.float32).eps * variances[-1]
        whitened = (directions / np.sqrt(np.maximum(variances, least))).astype(np.float32)
        all_directions = cls(units, mean.astype(np.float32), whitened)

        def information_of_part(part: slice, _number: int) -> Single:
            runs = _Runs.about(setup, inputs, answers[part])
            effects = all_directions.z(rows[part], runs)[1].reshape(-1, len(mean))
            modelled = runs.rows.reshape(len(runs.means), -1, *rows.shape[1:])[:, 0]
            directions = deviation_directions(modelled, other_descriptions(setup, inputs, runs.means))
            errors = all_directions.whitened(directions.reshape(-1, *rows.shape[1:]))
            changes = np.concatenate([effects, errors])
            changes /= np.maximum(1.0, np.sqrt(np.mean(changes**2, axis=1, keepdims=True)))
            return np.asarray(changes.T @ changes)

        information = np.zeros_like(covariance)
        for products in of_parts(information_of_part, min(len(rows), UPDATE.directions), UPDATE.at_once):
            information += products
        _, eigenvectors = np.linalg.eigh(information)
        basis = whitened @ eigenvectors[:, ::-1][:, : UPDATE.components]
        # In half precision, as in a file.
        return cls(units, all_directions.mean, basis.astype(np.float16).astype(np.float32))


def _discrepancy_moments(
    setup: RecordingSetup, inputs: Inputs, draws: TrainingSet, units: Array
) -> tuple[Array, Array]:
    """Return mean (rows,) and covariance (rows, rows) of the difference of draws from the averaged model.

    The draws are noise-free; the covariance of the noise is added. Both are in `units` (channels,), all
    channels concatenated.
    """
    width = draws.rows[0].size
    total, products = np.zeros(width), np.zeros((width, width))

    def moments_of_part(part: slice, _number: int) -> tuple[Single, Single]:
        some_draws = draws[part]
        averaged = simulated(setup, inputs, AVERAGED, some_draws.points.astype(float))
        differences = in_units(some_draws.rows - averaged, units)
        differences = np.clip(differences, -UPDATE.largest_row, UPDATE.largest_row)
        return differences.sum(axis=0), differences.T @ differences

    for sums, squares in of_parts(moments_of_part, len(draws), AVERAGED_AT_ONCE):
        total += sums
        products += squares
    mean = total / len(draws)
    noise = np.repeat((noise_rms(setup) / units) ** 2, draws.rows.shape[-1])
    return mean, products / len(draws) - np.outer(mean, mean) + np.diag(noise)


@dataclass(frozen=True, eq=False)
class _Runs:
    """Runs of the averaged model about n answers.

    `factors` F₁ (n, d, d) and `means` θ₁ (n, d); `rows` (n × (d + 1), channels, blocks) at θ₁ and at d points
    about it; `moves` (n, d, d) are the steps from θ₁ to these points in units of F₁, one row per run.
    """

    factors: Array
    means: Array
    rows: Single
    moves: Array

    @classmethod
    def about(cls, setup: RecordingSetup, inputs: Inputs, answers: Sequence[Mixture]) -> Self:
        """Return the runs about each of the n answers."""
        space = setup.space
        d = space.dimensions
        means = space.project(np.array([answer.mean for answer in answers]))
        factors = np.linalg.cholesky(np.array([answer.covariance for answer in answers]))
        points = _steps_within_bounds(space, means, factors.transpose(0, 2, 1))
        all_points = np.concatenate([means[:, np.newaxis], points], axis=1).reshape(-1, d)
        steps = (points - means[:, np.newaxis]).transpose(0, 2, 1)
        moves = np.asarray(np.linalg.solve(factors, steps), float).transpose(0, 2, 1)
        return cls(factors, means, simulated(setup, inputs, AVERAGED, all_points), moves)


def _steps_within_bounds(space: ParameterSpace, means: Array, steps: Array) -> Array:
    """Return the points (n, d, d) at means (n, d) plus or minus `steps` (n, d, d), within the bounds.

    The sign is that with which the bounds shorten the step less.
    """
    candidates = [means[:, np.newaxis] + sign * steps for sign in (1.0, -1.0)]
    inside = [
        space.project(points.reshape(-1, points.shape[-1])).reshape(points.shape) for points in candidates
    ]
    shortened = [
        np.abs(points - limited).sum(axis=-1) for points, limited in zip(candidates, inside, strict=True)
    ]
    return np.where((shortened[0] > shortened[1])[..., np.newaxis], inside[1], inside[0])


@dataclass(frozen=True, eq=False)
class UpdateStep:
    """Gauss-Newton steps from n answers, as the second network reads them.

    `means` θ₂ (n, d), the Cholesky `factors` (n, d, d) of the units about θ₂, and `features` (n,
    `feature_count`), the network's input.
    """

    means: Array
    factors: Array
    features: Single

    @staticmethod
    def of(
        setup: RecordingSetup,
        inputs: Inputs,
        whitening: Whitening,
        rows: Single,
        answers: Sequence[Mixture],
    ) -> "UpdateStep":
        """Return the Gauss-Newton steps from the answers for rows (n, channels, blocks)."""
        parts = [slice(i, i + UPDATE.at_once) for i in range(0, len(rows), UPDATE.at_once)]
        return UpdateStep.joined(
            [_step(setup, inputs, whitening, rows[part], answers[part]) for part in parts]
        )

    @staticmethod
    def joined(parts: Sequence["UpdateStep"]) -> "UpdateStep":
        """Return the steps of all parts, in their order."""
        fields = ((part.means, part.factors, part.features) for part in parts)
        return UpdateStep(*(np.concatenate(arrays) for arrays in zip(*fields, strict=True)))

    def units_of(self, points: Array) -> Array:
        """Return the deviations of points (n, d) from θ₂ in units of `factors`, (n, d)."""
        return np.asarray(np.linalg.solve(self.factors, (points - self.means)[..., np.newaxis])[..., 0])

    def points_of(self, units: Array) -> Array:
        """Return the points (n, d) at deviations `units` (n, d); the inverse of `units_of`."""
        return np.asarray(self.means + np.einsum("nij,nj->ni", self.factors, units))


def _step(
    setup: RecordingSetup, inputs: Inputs, whitening: Whitening, rows: Single, answers: Sequence[Mixture]
) -> UpdateStep:
    """Return the steps from answers that are compared together."""
    runs = _Runs.about(setup, inputs, answers)
    identity = np.eye(runs.means.shape[1])
    z, differences = whitening.z(rows, runs)
    transposed = runs.moves.transpose(0, 2, 1)
    jacobians = np.linalg.solve(transposed @ runs.moves + UPDATE.ridge * identity, transposed @ differences)
    information = jacobians @ jacobians.transpose(0, 2, 1)
    gradient = jacobians @ np.clip(z, -UPDATE.largest, UPDATE.largest)[..., np.newaxis]
    covariance = np.linalg.inv(information + identity)
    x = np.clip((covariance @ gradient)[..., 0], -UPDATE.longest, UPDATE.longest)
    means = runs.means + np.einsum("nij,nj->ni", runs.factors, x)
    covariance = runs.factors @ covariance @ runs.factors.transpose(0, 2, 1)
    variances = np.einsum("nij,nij->ni", runs.factors, runs.factors)
    covariance += UPDATE.floor**2 * variances[:, :, np.newaxis] * identity
    factors = np.linalg.cholesky((covariance + covariance.transpose(0, 2, 1)) / 2)
    features = [
        np.arcsinh(z),
        x,
        np.log1p(np.einsum("nii->ni", information)),
        means / setup.space.prior_deviations,
        np.log(variances) / 2,
    ]
    return UpdateStep(
        np.asarray(means), np.asarray(factors, float), np.concatenate(features, axis=1).astype(np.float32)
    )


@dataclass(frozen=True, eq=False)
class ModelUpdate:
    """The whitening, and the second network."""

    whitening: Whitening
    network: Network

    def answers(
        self, setup: RecordingSetup, inputs: Inputs, rows: Single, first: Sequence[Mixture]
    ) -> list[Mixture]:
        """Return the posteriors of n recordings, from their rows and the `first` answers."""
        step = UpdateStep.of(setup, inputs, self.whitening, rows, first)
        mixtures = self.network.mixtures(self.network.features(step.features))
        return [
            Mixture(mixture.weights, mean + mixture.means @ factor.T, factor @ mixture.factors)
            for mixture, mean, factor in zip(mixtures, step.means, step.factors, strict=True)
        ]


def feature_count(components: int, dimensions: int) -> int:
    """Return the number of features that the second network reads."""
    return components + 4 * dimensions
