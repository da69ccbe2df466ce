"""The layers of an estimator's networks, for values (n, width) of n recordings.

`network` has their equations.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from emaphm.amortized.networks.half_precision import Bits, add_product
from emaphm.arrays import Single

EPSILON = 1e-5
"""Added to the variance that a layer is normalised by."""


@dataclass(frozen=True, eq=False)
class Normalisation:
    """g and c of a layer's norm, (width,) each."""

    scale: Single
    shift: Single

    def __call__(self, h: Single) -> Single:
        """Return the normalised (n, width) values."""
        # Sums, not means: of one recording, half of the time would be spent in calling `mean`.
        width = np.float32(h.shape[1])
        centred = h - np.add.reduce(h, axis=1, keepdims=True) / width
        variance = np.add.reduce(centred * centred, axis=1, keepdims=True) / width
        centred *= 1 / np.sqrt(variance + np.float32(EPSILON))
        return np.asarray(centred * self.scale + self.shift)


FEW = 5
"""Recordings up to which a product reads half-precision numbers: of eight, BLAS takes as long (measured)."""


@dataclass(frozen=True, eq=False)
class Dense:
    """W (inputs, outputs), of half precision though single in memory, and b (outputs,) of a layer."""

    weight: Single
    bias: Single

    def __call__(self, x: Single) -> Single:
        """Return W x + b of values (n, inputs)."""
        if len(x) > FEW:
            return np.asarray(x @ self.weight + self.bias)
        total = np.empty((len(x), self.bias.size), np.float32)
        total[:] = self.bias
        add_product(x, self._bits, total)
        return total

    @cached_property
    def _bits(self) -> Bits:
        return np.ascontiguousarray(self.weight, np.float16).view(np.uint16)


@dataclass(frozen=True, eq=False)
class Block:
    """A residual block."""

    norm: Normalisation
    first: Dense
    second: Dense

    def __call__(self, h: Single) -> Single:
        """Return values (n, width) after the block."""
        return h + self.second(silu(self.first(self.norm(h))))


def silu(x: Single) -> Single:
    """Return x / (1 + exp(-x))."""
    return np.asarray(x / (1 + np.exp(-x)))
