"""Layers of an estimator's networks, for values (n, width) of n recordings; equations in `network`."""

from dataclasses import dataclass
from functools import cache, cached_property
from typing import TYPE_CHECKING

import numpy as np

from emaphm.arrays import Single

if TYPE_CHECKING:
    from emaphm.amortized.networks.half_precision import Bits

EPSILON = 1e-5
"""Added to the variance by which a layer is normalised."""


@dataclass(frozen=True, eq=False)
class Normalisation:
    """Layer normalisation: g (`scale`) and c (`shift`), (width,) each."""

    scale: Single
    shift: Single

    def __call__(self, h: Single) -> Single:
        """Return the normalised values of `h` (n, width)."""
        # Sums are used because for one recording, the calls of `mean` would take half of the time.
        width = np.float32(h.shape[1])
        centred = h - np.add.reduce(h, axis=1, keepdims=True) / width
        variance = np.add.reduce(centred * centred, axis=1, keepdims=True) / width
        centred *= 1 / np.sqrt(variance + np.float32(EPSILON))
        return np.asarray(centred * self.scale + self.shift)


FEW = 8
"""Largest number of recordings for which a product reads half-precision weights. For twelve recordings,
BLAS in single precision takes as long (measured)."""


@cache
def reads_half_precision() -> bool:
    """Return whether half-precision weights can be read; if not, products are those of BLAS."""
    # Numba is imported with an answer only: a diagnosis without an estimator starts 0.2 s earlier.
    from emaphm.amortized.networks.half_precision import has_conversion

    return has_conversion()


@dataclass(frozen=True, eq=False)
class Dense:
    """Dense layer: W (inputs, outputs), half-precision values in single precision, and b (outputs,)."""

    weight: Single
    bias: Single

    def __call__(self, x: Single) -> Single:
        """Return W x + b (n, outputs) of values (n, inputs)."""
        if len(x) > FEW or not reads_half_precision():
            return np.asarray(x @ self.weight + self.bias)
        from emaphm.amortized.networks.half_precision import add_product

        total = np.empty((len(x), self.bias.size), np.float32)
        total[:] = self.bias
        add_product(x, self._bits, total)
        return total

    @cached_property
    def _bits(self) -> "Bits":
        return np.ascontiguousarray(self.weight, np.float16).view(np.uint16)


@dataclass(frozen=True, eq=False)
class Block:
    """Residual block of two dense layers."""

    norm: Normalisation
    first: Dense
    second: Dense

    def __call__(self, h: Single) -> Single:
        """Return the values (n, width) after the block."""
        return h + self.second(silu(self.first(self.norm(h))))


def silu(x: Single) -> Single:
    """Return x / (1 + exp(-x))."""
    return np.asarray(x / (1 + np.exp(-x)))
