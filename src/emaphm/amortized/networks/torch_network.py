"""The network of `emaphm.amortized.networks.network` as a PyTorch module, for its training."""

import math
from typing import Any

import llvmlite.binding as llvm
import numpy as np

from emaphm.amortized.networks.layers import EPSILON, Block, Dense, Normalisation
from emaphm.amortized.networks.network import HIGHEST_LOG, LOWEST_LOG, Network, output_width
from emaphm.amortized.networks.projection import Projection
from emaphm.arrays import Array
from emaphm.optional_library import import_library

LOG_ROOT_2PI = 0.5 * math.log(2 * math.pi)

FIRST_SCATTER = 0.3
"""Scatter of the components' initial means, in prior deviations: components with equal initial means would
stay equal."""


def library() -> Any:
    """Return the module `torch`, an optional dependency; `MethodError` if it is not installed."""
    return import_library("training, unlike asking an estimator,", "torch", "train")


def torch_module(
    principal: int,
    width: int,
    depth: int,
    components: int,
    dimensions: int,
    *,
    half_precision: bool = False,
) -> Any:
    """Return a module with the layers of `Network`, whose input are features (n, principal).

    With `half_precision`, its blocks multiply in bfloat16 during training if that is faster. The other layers
    have single precision: the eight significant bits of bfloat16 resolve a leading component less finely than
    a sensor does.
    """
    torch = library()
    nn = torch.nn
    faster = half_precision and has_half_precision(torch)

    class Residual(nn.Module):  # type: ignore[name-defined,misc]
        def __init__(self) -> None:
            super().__init__()
            self.norm = nn.LayerNorm(width, eps=EPSILON)
            self.first, self.second = nn.Linear(width, width), nn.Linear(width, width)

        def forward(self, h: Any) -> Any:
            with torch.autocast("cpu", torch.bfloat16, enabled=faster and self.training):
                added = self.second(nn.functional.silu(self.first(self.norm(h))))
            return h + added.float()

    class Estimating(nn.Module):  # type: ignore[name-defined,misc]
        def __init__(self) -> None:
            super().__init__()
            self.entry = nn.Linear(principal, width)
            self.blocks = nn.ModuleList([Residual() for _ in range(depth)])
            self.norm = nn.LayerNorm(width, eps=EPSILON)
            self.exit = nn.Linear(width, output_width(components, dimensions))
            with torch.no_grad():
                bias = self.exit.bias.reshape(components, -1)
                bias.zero_()
                bias[:, 1 : 1 + dimensions].normal_(0.0, FIRST_SCATTER if components > 1 else 0.0)

        def forward(self, features: Any) -> Any:
            h = self.entry(features)
            for block in self.blocks:
                h = block(h)
            return self.exit(self.norm(h))

    return Estimating()


def has_half_precision(torch: Any) -> bool:
    """Return whether the processor multiplies matrices of bfloat16 faster than those of single precision.

    Intel's processors do so with AMX tiles only: with AVX-512 instructions for bfloat16, a step of the first
    network took 52 ms instead of 36 ms (measured). AMD's processors have no tiles, and twice the rate with
    these instructions (documented, not measured).
    """
    is_amd = str(llvm.get_host_cpu_name()).startswith("znver")
    # PyTorch has no public function for this; another release may lack the private one.
    supported = getattr(torch.cpu, "_is_avx512_bf16_supported" if is_amd else "_is_amx_tile_supported", None)
    return bool(supported and supported())


def loss(outputs: Any, points: Any, components: int) -> Any:
    """Return -log p(points) (n,) for the mixtures in `outputs`; `points` (n, d) in prior deviations."""
    torch = library()
    n, d = points.shape
    outputs = outputs.reshape(n, components, -1)
    means, lower = outputs[..., 1 : 1 + d], outputs[..., 1 + d :]
    rows, columns = torch.tril_indices(d, d)
    matrix = torch.zeros(n, components, d, d, dtype=outputs.dtype)
    matrix[..., rows, columns] = lower
    logs = torch.diagonal(matrix, dim1=2, dim2=3).clamp(LOWEST_LOG, HIGHEST_LOG)
    factor = torch.tril(matrix, -1) + torch.diag_embed(logs.exp())
    standard = torch.einsum("nmij,nmj->nmi", factor, points[:, None] - means)
    log_densities = logs.sum(-1) - 0.5 * standard.square().sum(-1) - d * LOG_ROOT_2PI
    return -torch.logsumexp(torch.log_softmax(outputs[..., 0], dim=1) + log_densities, dim=1)


def converted(module: Any, projection: Projection, deviations: Array, components: int) -> Network:
    """Return the network of a trained module, its weights rounded to half precision as in a file."""

    def half(values: Any) -> Any:
        return values.detach().numpy().astype(np.float16).astype(np.float32)

    def dense(layer: Any) -> Dense:
        return Dense(np.ascontiguousarray(half(layer.weight).T), half(layer.bias))

    def norm(layer: Any) -> Normalisation:
        return Normalisation(half(layer.weight), half(layer.bias))

    return Network(
        projection,
        dense(module.entry),
        tuple(Block(norm(block.norm), dense(block.first), dense(block.second)) for block in module.blocks),
        norm(module.norm),
        dense(module.exit),
        deviations,
        components,
    )
