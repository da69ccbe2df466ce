"""Compiled product with a matrix in half precision, for a few recordings.

For one recording, a product takes the time of reading the matrix. In half precision, the matrix has half the
bytes of single precision; the processor converts sixteen or fewer numbers with one instruction.
"""

from typing import Any

import numpy as np
from llvmlite import binding, ir
from numba import njit, types
from numba.extending import intrinsic
from numpy.typing import NDArray

from emaphm.arrays import Single

Bits = NDArray[np.uint16]
"""Half-precision numbers (IEEE 754 binary16) as bits."""


def has_conversion() -> bool:
    """Return whether the processor has an instruction that converts half to single precision.

    Of the processors with an x86 instruction set, those from before 2012 have none.
    """
    is_x86 = binding.get_process_triple().startswith(("x86", "i686"))
    return not is_x86 or binding.get_host_cpu_features().get("f16c", False)


def _conversion(_typing: Any, _bits: Any) -> Any:
    """Return signature and code of the conversion of `_bits` to single precision, for Numba."""

    def generated(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return builder.fpext(builder.bitcast(arguments[0], ir.HalfType()), ir.FloatType())

    return types.float32(types.uint16), generated


_single: Any = intrinsic(_conversion)


@njit(cache=True, fastmath=True, nogil=True)
def add_product(left: Single, right: Bits, total: Any) -> None:
    """Add `left` (n, k) times `right` (k, m) to `total` (n, m); `right` is finite, in half precision."""
    # One row after the other: for a matrix that is not in the cache, four at once take 1.2 times as long.
    for i in range(right.shape[0]):
        for n in range(left.shape[0]):
            for j in range(right.shape[1]):
                total[n, j] += left[n, i] * _single(right[i, j])
