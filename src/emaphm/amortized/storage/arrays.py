"""The arrays of an estimator's file: their names, shapes and number types, and their reading."""

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
"""Number types: half precision for the networks, which adds 0.01 % to an error; double for other arrays."""

ORDERS: tuple[Literal["C"], Literal["F"]] = ("C", "F")
"""Memory orders of an array: by rows or by columns."""

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
"""Last parts of the names of the arrays that are stored in double precision."""

POSITIVE = ("units", "scatter", "deviations", "temperature")
"""Last parts of the names of divisors and scale factors, which must be positive."""

FIRST, UPDATE, PREDICTOR = "network", "update", "error_predictor"
"""Names of the networks."""


def kind_of(name: str) -> str:
    """Return the number type in which an array is stored."""
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
        weight, bias = (layer.weight, layer.bias) if isinstance(layer, Dense) else (layer.scale, layer.shift)
        arrays |= {f"{of}.{name}.weight": weight, f"{of}.{name}.bias": bias}
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
    """Return the shapes of the arrays of the network named `of`, which has `inputs` inputs."""
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
    """Return the array `name` of a file, in the number type in which it is stored.

    Raises
    ------
    MethodError
        The array is missing, has another shape or number type, or has values that no estimator has.
    """
    kind = np.dtype(kind_of(name))
    size = kind.itemsize * math.prod(shape)
    headers = {order: _array_header(kind, shape, order) for order in ORDERS}
    try:
        member = archive.getinfo(f"{name}.npy")
    except KeyError:
        raise no_estimator(path, f"'{name}' is missing") from None
    if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise no_estimator(path, f"'{name}' is compressed by a method that emaphm does not use")
    # The header is compared with the expected bytes and never parsed, so that a forged one is harmless.
    fits = member.file_size in {len(header) + size for header in headers.values()}
    content = archive.read(member) if fits else b""
    order = next((order for order, header in headers.items() if content.startswith(header)), None)
    if order is None or len(content) != len(headers[order]) + size:
        raise no_estimator(path, f"'{name}' has another shape or kind than the estimator's header says")
    values = np.frombuffer(content, kind, offset=len(headers[order])).reshape(shape, order=order)
    if not np.all(np.isfinite(values)):
        raise no_estimator(path, f"'{name}' is not finite")
    if name.rpartition(".")[2] in POSITIVE and not np.all(values > 0):
        raise no_estimator(path, f"'{name}' is not above 0")
    if name.startswith("limits.") and not np.all(values >= 0):
        raise no_estimator(path, f"'{name}' is below 0")
    return np.asarray(values)


def _array_header(kind: np.dtype[Any], shape: tuple[int, ...], order: Literal["C", "F"]) -> bytes:
    """Return the header that NumPy writes before the numbers of an array in the memory `order`."""
    buffer = io.BytesIO()
    description = {"descr": kind.str, "fortran_order": order == "F", "shape": shape}
    np.lib.format.write_array_header_1_0(buffer, description)
    return buffer.getvalue()


def network_of(of: str, header: NetworkHeader, arrays: dict[str, Array]) -> Network:
    """Return the network named `of` from its header and the arrays of the file."""

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
    """Return the whitening of the second network's comparison."""
    return Whitening(
        arrays["compared.units"], _single(arrays["compared.mean"]), _single(arrays["compared.basis"])
    )


def _single(values: Array) -> Any:
    return values.astype(np.float32)
