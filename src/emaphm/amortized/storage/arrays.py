"""The arrays of an estimator's file: which it has, of which shape and kind, and how each is read."""

import io
import math
import zipfile
from pathlib import Path
from typing import Any, Literal

import numpy as np

from emaphm.amortized.content import EstimatorContent
from emaphm.amortized.error_prediction.comparison import predictor_feature_count
from emaphm.amortized.model_update import Whitening, feature_count
from emaphm.amortized.networks.layers import Block, Dense, Normalisation
from emaphm.amortized.networks.network import Network, output_width
from emaphm.amortized.networks.projection import Projection
from emaphm.amortized.simulating import block_of
from emaphm.amortized.storage.header import Header, NetworkHeader, no_estimator
from emaphm.arrays import Array

WEIGHTS, EXACT = "<f2", "<f8"
"""Kinds of numbers: half precision of the network's, which costs 0.01 % of an error; double of the others."""

ORDERS: tuple[Literal["C"], Literal["F"]] = ("C", "F")
"""Of the numbers of an array, by rows or by columns."""

DOUBLE = (
    "command_rad",
    "units",
    "mean",
    "scatter",
    "deviations",
    "temperature",
    "distances",
    "ratios",
    "predicted_error",
)
"""Last parts of the names of what is kept exactly."""

POSITIVE = ("units", "scatter", "deviations", "temperature")
"""Of these what others are divided or scaled by."""

FIRST, UPDATE, PREDICTOR = "network", "update", "error_predictor"
"""Names of the networks."""


def kind_of(name: str) -> str:
    """Return as which kind of numbers an array is kept."""
    return EXACT if name.rpartition(".")[2] in DOUBLE else WEIGHTS


def arrays_of(content: EstimatorContent) -> dict[str, Any]:
    """Return the arrays of an estimator by name."""
    update = content.update
    return {
        "command_rad": content.setup.command_rad,
        "temperature": content.temperature,
        "limits.distances": content.limits.distances,
        "limits.ratios": content.limits.ratios,
        "limits.predicted_error": np.array([content.limits.predicted_error]),
        "compared.units": update.whitening.units,
        "compared.mean": update.whitening.mean,
        "compared.basis": update.whitening.basis,
        **_network_arrays(FIRST, content.network),
        **_network_arrays(UPDATE, update.network),
        **_network_arrays(PREDICTOR, content.error_predictor.network),
    }


def _network_arrays(of: str, network: Network) -> dict[str, Array]:
    """Return the arrays of the network named `of`."""
    layers: dict[str, Any] = {"entry": network.entry, "exit": network.exit, "norm": network.norm}
    for i, block in enumerate(network.blocks):
        layers |= {f"norm{i}": block.norm, f"first{i}": block.first, f"second{i}": block.second}
    projection = network.projection
    arrays: dict[str, Any] = {
        f"{of}.units": projection.units,
        f"{of}.mean": projection.mean,
        f"{of}.basis": projection.basis,
        f"{of}.scatter": projection.deviations,
        f"{of}.deviations": network.deviations,
    }
    for name, layer in layers.items():
        one, other = (layer.weight, layer.bias) if isinstance(layer, Dense) else (layer.scale, layer.shift)
        arrays |= {f"{of}.{name}.weight": one, f"{of}.{name}.bias": other}
    return arrays


def shapes_of(header: Header) -> dict[str, tuple[int, ...]]:
    """Return the shape that each array must have."""
    channels, rows, d = len(header.setup.channels), header.setup.rows, len(header.coordinates)
    width = channels * (rows // block_of(rows))
    return {
        "command_rad": (rows,),
        "temperature": (d,),
        "limits.distances": (2,),
        "limits.ratios": (channels,),
        "limits.predicted_error": (1,),
        "compared.units": (channels,),
        "compared.mean": (width,),
        "compared.basis": (width, header.compared),
        **_network_shapes(FIRST, header.network, channels, width, d),
        **_network_shapes(UPDATE, header.update, 1, feature_count(header.compared, d), d),
        **_network_shapes(PREDICTOR, header.error_predictor, 1, predictor_feature_count(channels, d), 1),
    }


def _network_shapes(
    of: str, net: NetworkHeader, channels: int, inputs: int, d: int
) -> dict[str, tuple[int, ...]]:
    """Return the shapes of the arrays of the network named `of`, which reads `inputs` numbers."""
    width = net.width
    shapes: dict[str, tuple[int, ...]] = {
        "units": (channels,),
        "mean": (inputs,),
        "basis": (inputs, net.principal),
        "scatter": (net.principal,),
        "deviations": (d,),
        "entry.weight": (net.principal, width),
        "entry.bias": (width,),
        "norm.weight": (width,),
        "norm.bias": (width,),
        "exit.weight": (width, output_width(net.components, d)),
        "exit.bias": (output_width(net.components, d),),
    }
    for i in range(net.depth):
        shapes |= {f"norm{i}.weight": (width,), f"norm{i}.bias": (width,)}
        for layer in ("first", "second"):
            shapes |= {f"{layer}{i}.weight": (width, width), f"{layer}{i}.bias": (width,)}
    return {f"{of}.{name}": shape for name, shape in shapes.items()}


def read_array(archive: zipfile.ZipFile, name: str, shape: tuple[int, ...], path: Path) -> Array:
    """Return an array of a file, in the kind of numbers that was kept.

    Raises
    ------
    MethodError
        It is missing, of another shape or kind, or holds what no estimator has.
    """
    wanted = np.dtype(kind_of(name))
    size = wanted.itemsize * math.prod(shape)
    headers = {order: _array_header(wanted, shape, order) for order in ORDERS}
    try:
        member = archive.getinfo(f"{name}.npy")
    except KeyError:
        raise no_estimator(path, f"'{name}' is missing") from None
    if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise no_estimator(path, f"'{name}' is compressed in another way than ours")
    # The header that was written is compared, not read: one that is made up never is.
    fits = member.file_size in {len(header) + size for header in headers.values()}
    content = archive.read(member) if fits else b""
    order = next((one for one, header in headers.items() if content.startswith(header)), None)
    if order is None or len(content) != len(headers[order]) + size:
        raise no_estimator(path, f"'{name}' has another shape or kind than the estimator's header says")
    values = np.frombuffer(content, wanted, offset=len(headers[order])).reshape(shape, order=order)
    if not np.all(np.isfinite(values)):
        raise no_estimator(path, f"'{name}' is not finite")
    if name.rpartition(".")[2] in POSITIVE and not np.all(values > 0):
        raise no_estimator(path, f"'{name}' is not above 0")
    if name.startswith("limits.") and not np.all(values >= 0):
        raise no_estimator(path, f"'{name}' is below 0")
    return np.asarray(values)


def _array_header(kind: np.dtype[Any], shape: tuple[int, ...], order: Literal["C", "F"]) -> bytes:
    """Return what NumPy writes before the numbers of an array, by rows or by columns."""
    begin = io.BytesIO()
    about = {"descr": kind.str, "fortran_order": order == "F", "shape": shape}
    np.lib.format.write_array_header_1_0(begin, about)
    return begin.getvalue()


def network_of(of: str, header: NetworkHeader, arrays: dict[str, Array]) -> Network:
    """Return the network named `of`."""

    def dense(name: str) -> Dense:
        return Dense(_single(arrays[f"{of}.{name}.weight"]), _single(arrays[f"{of}.{name}.bias"]))

    def norm(name: str) -> Normalisation:
        return Normalisation(_single(arrays[f"{of}.{name}.weight"]), _single(arrays[f"{of}.{name}.bias"]))

    projection = Projection(
        arrays[f"{of}.units"],
        _single(arrays[f"{of}.mean"]),
        _single(arrays[f"{of}.basis"]),
        arrays[f"{of}.scatter"],
    )
    blocks = tuple(
        Block(norm(f"norm{i}"), dense(f"first{i}"), dense(f"second{i}")) for i in range(header.depth)
    )
    return Network(
        projection,
        dense("entry"),
        blocks,
        norm("norm"),
        dense("exit"),
        arrays[f"{of}.deviations"],
        header.components,
    )


def whitening_of(arrays: dict[str, Array]) -> Whitening:
    """Return how the second network's comparison is whitened."""
    return Whitening(
        arrays["compared.units"], _single(arrays["compared.mean"]), _single(arrays["compared.basis"])
    )


def _single(values: Array) -> Any:
    return values.astype(np.float32)
