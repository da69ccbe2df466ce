"""The network of an estimator, in NumPy: from rows of channels to a mixture of normal distributions.

Rows, in the channels' units, are projected on the principal components of the training set. Residual blocks
of two dense layers follow:

    z = B (x - m),   h ← W₀ z + b₀,   h ← h + W₂ silu(W₁ norm(h) + b₁) + b₂ (each block),   o = W norm(h) + b,

with silu(x) = x / (1 + exp(-x)) and norm(h) = g (h - mean h) / std h + c (Ba et al. 2016). For each
component of the mixture, o has the logit of its weight, its mean μ, and the lower triangle of L, Σ⁻¹ = Lᵀ L,
with the logarithm of the diagonal in place of the diagonal. Coordinates are in units of their prior
deviation.

The evaluation needs one product of a matrix and a vector per layer, and therefore no library except NumPy.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from emaphm.amortized.networks.layers import Block, Dense, Normalisation
from emaphm.amortized.networks.mixture import Mixture
from emaphm.amortized.networks.projection import Projection
from emaphm.arrays import Array, Single

LOWEST_LOG, HIGHEST_LOG = -6.0, 9.0
"""Bounds of the logarithm of a standard deviation's inverse, in units of the prior's: a standard deviation is
between 0.01 % and 400 times that of the prior."""


@dataclass(frozen=True, eq=False)
class Network:
    """The projection and all layers of a network.

    `deviations` (d,) are the units of the coordinates, `components` is the number of mixture components.
    """

    projection: Projection
    entry: Dense
    blocks: tuple[Block, ...]
    norm: Normalisation
    exit: Dense
    deviations: Array
    components: int

    @property
    def dimensions(self) -> int:
        """The number of estimated coordinates."""
        return int(self.deviations.size)

    @property
    def parameters(self) -> int:
        """The number of parameters of the network, including the projection."""
        dense = [self.projection.layer, self.entry, self.exit]
        dense += [layer for block in self.blocks for layer in (block.first, block.second)]
        norms = [self.norm, *(block.norm for block in self.blocks)]
        return sum(layer.weight.size + layer.bias.size for layer in dense) + sum(
            2 * norm.scale.size for norm in norms
        )

    def features(self, rows: Single) -> Single:
        """Return the principal components z (n, k) of rows (n, channels, blocks)."""
        return self.projection.features(rows)

    def distances(self, rows: Single) -> Array:
        """Return the distances T² and Q of rows (n, channels, blocks) from the training set, (n, 2)."""
        return self.projection.distances(rows, self.features(rows))

    def outputs(self, features: Single) -> Single:
        """Return o (n, components × (1 + d + d (d + 1) / 2)) for `features` (n, k)."""
        h = self.entry(features)
        for block in self.blocks:
            h = block(h)
        return self.exit(self.norm(h))

    def mixtures(self, features: Single) -> list[Mixture]:
        """Return the mixture for each row of `features` (n, k)."""
        d = self.dimensions
        outputs = self.outputs(features).astype(float).reshape(len(features), self.components, -1)
        logits = outputs[..., 0] - outputs[..., 0].max(axis=1, keepdims=True)
        weights = np.exp(logits)
        weights /= weights.sum(axis=1, keepdims=True)
        means = outputs[..., 1 : 1 + d] * self.deviations
        lower = np.zeros((*outputs.shape[:2], d, d))
        lower[..., *_triangle(d)] = outputs[..., 1 + d :]
        diagonal = np.einsum("nmii->nmi", lower)
        diagonal[...] = np.exp(np.clip(diagonal, LOWEST_LOG, HIGHEST_LOG))
        # Σ = (Lᵀ L)⁻¹ = L⁻¹ L⁻ᵀ.
        factors = np.linalg.inv(lower) * self.deviations[:, np.newaxis]
        return [Mixture(*fields) for fields in zip(weights, means, factors, strict=True)]


@cache
def _triangle(d: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the indices of a lower triangle (d, d); computing them takes as long as a dense layer."""
    return np.tril_indices(d)


def output_width(components: int, dimensions: int) -> int:
    """Return the length of o."""
    return components * (1 + dimensions + dimensions * (dimensions + 1) // 2)
