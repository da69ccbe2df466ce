"""The update of a network's answer by the averaged model: one Gauss-Newton step, judged by a second network.

A network that reads rows alone has seen few actuators like the one at hand. The averaged model says what
those rows would be: it is run at the answer's mean θ₁ and, for each coordinate, one standard deviation away
along the columns of F₁, Σ₁ = F₁ F₁ᵀ. With the residual r of that run and the differences J of the others,

    z = B (r - m),   x = (1 + Jᵀ BᵀB J)⁻¹ Jᵀ Bᵀ z,   θ₂ = θ₁ + F₁ x,   Σ₂ = F₁ (1 + Jᵀ BᵀB J)⁻¹ F₁ᵀ:

least squares with the answer as the prior (Tarantola 2005, ch. 3). m is the mean of what separates the
reference model from the averaged one over the training set, and B whitens its scatter: rows in which the two
differ anyway, by the switching mostly, count for little.

Neither a linear model nor a discrepancy that is independent of the faults is right. A second network reads
z, x, the information, θ₂ and the standard deviations, and gives the posterior as a mixture about θ₂, in units
of Σ₂ and a share of Σ₁. It has learned from the same draws as the first, with other noise. Those answers are
somewhat better than the ones for recordings, which held-out draws make up for (`emaphm.amortized.judging`).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np

from emaphm.amortized.error_prediction.deviations import deviation_directions, other_descriptions
from emaphm.amortized.networks.mixture import Mixture
from emaphm.amortized.networks.network import Network
from emaphm.amortized.parts import of_parts
from emaphm.amortized.recording_setup import RecordingSetup
from emaphm.amortized.simulating import TrainingSet, noise_rms, simulated
from emaphm.arrays import Array, Single
from emaphm.estimation.space.parameter_space import ParameterSpace
from emaphm.simulation import AVERAGED, Inputs


@dataclass(frozen=True)
class UpdateSettings:
    """How an answer is compared with the averaged model.

    m and B are those of `differing` draws at most. B has `components` rows, chosen by `directions` answers at
    most. A residual counts up to `largest_row` units in a row and up to `largest` standard deviations in z; a
    step goes up to `longest` of the answer's. Differences are divided by moves with a `ridge`: a run that a
    bound has held says little. Units are `floor` of the answer's standard deviations at least: no linear
    model is as sure as a large J would have it. `at_once` answers are compared together, which takes 130 MB.
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
"""Runs of the averaged model that are compared with the reference model's together, which takes 100 MB."""


@dataclass(frozen=True, eq=False)
class Whitening:
    """`units` (channels,) of rows, and m (rows,) and Bᵀ (rows, k) in these units, all channels end to end."""

    units: Array
    mean: Single
    basis: Single

    def z(self, rows: Single, runs: "_Runs") -> tuple[Array, Array]:
        """Return z (n, k) of rows (n, channels, blocks), and B times the runs' differences, (n, d, k)."""
        whole = self.whitened(np.concatenate([rows, runs.rows]))
        recorded, modelled = whole[: len(rows)], whole[len(rows) :].reshape(len(rows), -1, whole.shape[1])
        residual = recorded - modelled[:, 0] - self.whitened_mean
        return residual.astype(float), (modelled[:, 1:] - modelled[:, :1]).astype(float)

    def whitened(self, rows: Single) -> Single:
        """Return B times rows (n, channels, blocks), (n, k)."""
        return np.asarray(_flat(rows, self.units) @ self.basis)

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
        """Return the whitening of what noise-free `draws` differ by from the averaged model, and of noise.

        Of its directions, those are kept in which the averaged model moves most about `answers` for `rows`,
        and in which errors of sensors and of the description would show most.
        """
        mean, covariance = _differences(setup, inputs, draws, units)
        variances, directions = np.linalg.eigh(covariance)
        least = np.finfo(np.float32).eps * variances[-1]
        whitened = (directions / np.sqrt(np.maximum(variances, least))).astype(np.float32)
        whole = cls(units, mean.astype(np.float32), whitened)

        def informing(part: slice, _number: int) -> Single:
            runs = _Runs.about(setup, inputs, answers[part])
            moved = whole.z(rows[part], runs)[1].reshape(-1, len(mean))
            modelled = runs.rows.reshape(len(runs.means), -1, *rows.shape[1:])[:, 0]
            along = deviation_directions(modelled, other_descriptions(setup, inputs, runs.means))
            errors = whole.whitened(along.reshape(-1, *rows.shape[1:]))
            seen = np.concatenate([moved, errors])
            seen /= np.maximum(1.0, np.sqrt(np.mean(seen**2, axis=1, keepdims=True)))
            return np.asarray(seen.T @ seen)

        information = np.zeros_like(covariance)
        for products in of_parts(informing, min(len(rows), UPDATE.directions), UPDATE.at_once):
            information += products
        _, chosen = np.linalg.eigh(information)
        basis = whitened @ chosen[:, ::-1][:, : UPDATE.components]
        # As a file has it: of half precision.
        return cls(units, whole.mean, basis.astype(np.float16).astype(np.float32))


def _differences(
    setup: RecordingSetup, inputs: Inputs, draws: TrainingSet, units: Array
) -> tuple[Array, Array]:
    """Return mean (rows,) and covariance of what noise-free draws differ by from the averaged model.

    With that of the noise, in `units` (channels,), all channels end to end.
    """
    width = draws.rows[0].size
    total, products = np.zeros(width), np.zeros((width, width))

    def of_part(part: slice, _number: int) -> tuple[Single, Single]:
        some = draws[part]
        averaged = simulated(setup, inputs, AVERAGED, some.points.astype(float))
        found = _flat(some.rows - averaged, units)
        found = np.clip(found, -UPDATE.largest_row, UPDATE.largest_row)
        return found.sum(axis=0), found.T @ found

    for sums, squares in of_parts(of_part, len(draws), AVERAGED_AT_ONCE):
        total += sums
        products += squares
    mean = total / len(draws)
    noise = np.repeat((noise_rms(setup) / units) ** 2, draws.rows.shape[-1])
    return mean, products / len(draws) - np.outer(mean, mean) + np.diag(noise)


def _flat(rows: Single, units: Array) -> Single:
    """Return rows (n, channels, blocks) in units, all channels end to end, (n, rows)."""
    return np.asarray((rows / units[:, np.newaxis].astype(np.float32)).reshape(len(rows), -1))


@dataclass(frozen=True, eq=False)
class _Runs:
    """Runs of the averaged model about n answers.

    F₁ (n, d, d) and θ₁ (n, d), the `rows` at θ₁ and d points about it (n × (d + 1), channels, blocks), and
    the `moves` of these in units of F₁ (n, d, d), a row a run.
    """

    factors: Array
    means: Array
    rows: Single
    moves: Array

    @classmethod
    def about(cls, setup: RecordingSetup, inputs: Inputs, answers: Sequence[Mixture]) -> Self:
        """Return the runs about each of the answers (n)."""
        space = setup.space
        d = space.dimensions
        means = space.project(np.array([one.mean for one in answers]))
        factors = np.linalg.cholesky(np.array([one.covariance for one in answers]))
        points = _within(space, means, factors.transpose(0, 2, 1))
        every = np.concatenate([means[:, np.newaxis], points], axis=1).reshape(-1, d)
        away = (points - means[:, np.newaxis]).transpose(0, 2, 1)
        moves = np.asarray(np.linalg.solve(factors, away), float).transpose(0, 2, 1)
        return cls(factors, means, simulated(setup, inputs, AVERAGED, every), moves)


def _within(space: ParameterSpace, means: Array, steps: Array) -> Array:
    """Return means (n, d) plus or minus `steps` (n, d, d), whichever the bounds leave more of."""
    ways = [means[:, np.newaxis] + sign * steps for sign in (1.0, -1.0)]
    moved = [space.project(way.reshape(-1, way.shape[-1])).reshape(way.shape) for way in ways]
    lost = [np.abs(one - other).sum(axis=-1) for one, other in zip(ways, moved, strict=True)]
    return np.where((lost[0] > lost[1])[..., np.newaxis], moved[1], moved[0])


@dataclass(frozen=True, eq=False)
class UpdateStep:
    """θ₂ (n, d), the Cholesky factors (n, d, d) of the units about it, and what the second network reads."""

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
        """Return the steps of all the parts, in their order."""
        every = ((one.means, one.factors, one.features) for one in parts)
        return UpdateStep(*(np.concatenate(arrays) for arrays in zip(*every, strict=True)))

    def units_of(self, points: Array) -> Array:
        """Return points (n, d) in these units about θ₂."""
        return np.asarray(np.linalg.solve(self.factors, (points - self.means)[..., np.newaxis])[..., 0])

    def points_of(self, units: Array) -> Array:
        """Return the points (n, d) of what `units_of` returns."""
        return np.asarray(self.means + np.einsum("nij,nj->ni", self.factors, units))


def _step(
    setup: RecordingSetup, inputs: Inputs, whitening: Whitening, rows: Single, answers: Sequence[Mixture]
) -> UpdateStep:
    """Return the steps from answers that are compared together."""
    runs = _Runs.about(setup, inputs, answers)
    one = np.eye(runs.means.shape[1])
    z, moved = whitening.z(rows, runs)
    turned = runs.moves.transpose(0, 2, 1)
    jacobians = np.linalg.solve(turned @ runs.moves + UPDATE.ridge * one, turned @ moved)
    information = jacobians @ jacobians.transpose(0, 2, 1)
    gradient = jacobians @ np.clip(z, -UPDATE.largest, UPDATE.largest)[..., np.newaxis]
    covariance = np.linalg.inv(information + one)
    x = np.clip((covariance @ gradient)[..., 0], -UPDATE.longest, UPDATE.longest)
    means = runs.means + np.einsum("nij,nj->ni", runs.factors, x)
    covariance = runs.factors @ covariance @ runs.factors.transpose(0, 2, 1)
    variances = np.einsum("nij,nij->ni", runs.factors, runs.factors)
    covariance += UPDATE.floor**2 * variances[:, :, np.newaxis] * one
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
        """Return what is known of recordings (n), from their rows and the `first` answers."""
        step = UpdateStep.of(setup, inputs, self.whitening, rows, first)
        found = self.network.mixtures(self.network.features(step.features))
        return [
            Mixture(one.weights, mean + one.means @ factor.T, factor @ one.factors)
            for one, mean, factor in zip(found, step.means, step.factors, strict=True)
        ]


def feature_count(components: int, dimensions: int) -> int:
    """Return how many features the second network reads."""
    return components + 4 * dimensions
