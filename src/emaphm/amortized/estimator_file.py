"""An estimator in one file: a zip of a JSON header and plain arrays, nothing of which can be executed.

Every member's name, kind and shape is known before it is read, and so is the size of the whole.
"""

import io
import json
import math
import platform
import zipfile
import zlib
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from emaphm.actuator import Actuator
from emaphm.actuator.channels import Sampling
from emaphm.actuator.section import LARGEST, SMALLEST
from emaphm.amortized.error_prediction.comparison import predictor_feature_count
from emaphm.amortized.error_prediction.predictor import ErrorPredictor
from emaphm.amortized.model_update import ModelUpdate, Whitening, feature_count
from emaphm.amortized.networks.network import Block, Dense, Network, Normalisation, output_width
from emaphm.amortized.networks.projection import Projection
from emaphm.amortized.recording_setup import MOST_ROWS, RecordingSetup, check_channels
from emaphm.amortized.simulating import block_of
from emaphm.arrays import Array
from emaphm.errors import ActuatorError, MethodError
from emaphm.input_files import checked_size, is_newer_format
from emaphm.output_files import written_whole
from emaphm.version import VERSION

if TYPE_CHECKING:
    from emaphm.amortized.estimator import Estimator

FORMAT = "emaphm estimator 4"
HEADER = "header.json"

MOST_BYTES = 64 * 2**20
"""Largest file that is read [bytes], and largest content; one of the usual network has 8 MB."""

MOST_HEADER_BYTES = 4 * 2**20
WIDEST, DEEPEST, MOST_COMPONENTS = 4096, 32, 32

WEIGHTS, EXACT = "<f2", "<f8"
"""Kinds of numbers: half precision of the network's, which costs 0.01 % of an error; double of the others."""

ORDERS: tuple[Literal["C"], Literal["F"]] = ("C", "F")
"""Of the numbers of an array, by rows or by columns."""

DAMAGED = (
    zipfile.BadZipFile,
    zlib.error,
    OSError,
    ValueError,
    EOFError,
    NotImplementedError,
    RuntimeError,
)
"""What reading a damaged zip raises."""

DAMAGED_OR_OTHER = (
    "the file is damaged or of another version of emaphm; update it if that is a newer one, else train again"
)

Size = Annotated[int, Field(ge=1, le=WIDEST)]


class _Setup(BaseModel):
    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)

    actuator: dict[str, Any]
    rows: Annotated[int, Field(ge=2, le=MOST_ROWS)]
    interval_s: Annotated[float, Field(ge=SMALLEST, le=LARGEST)]
    sampling: Sampling
    channels: Annotated[list[str], Field(min_length=1, max_length=16)]
    noise: Annotated[float, Field(ge=0, le=LARGEST)]
    adc_bits: Annotated[int, Field(ge=4, le=24)] | None
    nuisances: list[str] | None
    initial_position: Annotated[float, Field(ge=-LARGEST, le=LARGEST)] = 0.0


class _Network(BaseModel):
    model_config = ConfigDict(extra="forbid")

    principal: Size
    width: Size
    depth: Annotated[int, Field(ge=1, le=DEEPEST)]
    components: Annotated[int, Field(ge=1, le=MOST_COMPONENTS)]

    @classmethod
    def of(cls, network: Network) -> "_Network":
        principal, width = network.entry.weight.shape
        return cls(principal=principal, width=width, depth=len(network.blocks), components=network.components)


class _Header(BaseModel):
    model_config = ConfigDict(extra="forbid")

    format: Literal["emaphm estimator 4"]
    version: str
    setup: _Setup
    coordinates: Annotated[list[str], Field(min_length=1, max_length=128)]
    network: _Network
    update: _Network
    error_predictor: _Network
    compared: Size
    facts: dict[str, Any]


def write_estimator(estimator: "Estimator", path: str | Path) -> None:
    """Write an estimator to one file; `OutputError` where it cannot be written."""
    setup, update = estimator.setup, estimator.update
    header = _Header(
        format=FORMAT,
        version=VERSION,
        setup=_Setup(
            actuator=setup.actuator.model_dump(mode="json", exclude_none=True),
            rows=setup.samples,
            interval_s=setup.interval_s,
            sampling="instant" if setup.sampling == "instant" else "mean",
            channels=list(setup.channels),
            noise=setup.noise,
            adc_bits=setup.adc_bits,
            nuisances=None if setup.nuisances is None else list(setup.nuisances),
            initial_position=setup.initial_position,
        ),
        coordinates=list(estimator.space.coordinates),
        network=_Network.of(estimator.network),
        update=_Network.of(update.network),
        error_predictor=_Network.of(estimator.error_predictor.network),
        compared=update.whitening.basis.shape[1],
        facts={
            **estimator.facts,
            "actuator_hash": estimator.actuator_hash,
            "python": platform.python_version(),
        },
    )
    with written_whole(path) as temporary, zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(HEADER, json.dumps(header.model_dump(), indent=1, allow_nan=False))
        for name, values in _arrays(estimator).items():
            kind = EXACT if name.rpartition(".")[2] in DOUBLE else WEIGHTS
            buffer = io.BytesIO()
            np.lib.format.write_array(buffer, values.astype(kind), allow_pickle=False)
            archive.writestr(f"{name}.npy", buffer.getvalue())


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


def _arrays(estimator: "Estimator") -> dict[str, Any]:
    update = estimator.update
    return {
        "command_rad": estimator.setup.command_rad,
        "temperature": estimator.temperature,
        "limits.distances": estimator.limits.distances,
        "limits.ratios": estimator.limits.ratios,
        "limits.predicted_error": np.array([estimator.limits.predicted_error]),
        "compared.units": update.whitening.units,
        "compared.mean": update.whitening.mean,
        "compared.basis": update.whitening.basis,
        **_network_arrays(FIRST, estimator.projection, estimator.network),
        **_network_arrays(UPDATE, update.projection, update.network),
        **_network_arrays(PREDICTOR, estimator.error_predictor.projection, estimator.error_predictor.network),
    }


def _network_arrays(of: str, projection: Projection, network: Network) -> dict[str, Array]:
    """Return the arrays of the network named `of`."""
    layers: dict[str, Any] = {"entry": network.entry, "exit": network.exit, "norm": network.norm}
    for i, block in enumerate(network.blocks):
        layers |= {f"norm{i}": block.norm, f"first{i}": block.first, f"second{i}": block.second}
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


def _shapes(header: _Header) -> dict[str, tuple[int, ...]]:
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


def _network_shapes(of: str, net: _Network, channels: int, inputs: int, d: int) -> dict[str, tuple[int, ...]]:
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


def read_estimator(path: Path, kind: "type[Estimator]") -> Any:
    """Return the estimator in a file; errors as in `Estimator.load`."""
    checked_size(path, MOST_BYTES, MethodError)
    try:
        with zipfile.ZipFile(path) as archive:
            return _estimator(archive, path, kind)
    except DAMAGED as error:
        if isinstance(error, MethodError):
            raise
        raise _no_estimator(path, " ".join(str(error).split())) from None


def _estimator(archive: zipfile.ZipFile, path: Path, kind: "type[Estimator]") -> Any:
    from emaphm.amortized.estimator import Limits

    sizes = {one.filename: one.file_size for one in archive.infolist()}
    if HEADER not in sizes or sizes[HEADER] > MOST_HEADER_BYTES:
        raise _no_estimator(path, f"it has no {HEADER}")
    header = _read_header(archive.read(HEADER), path)
    shapes = _shapes(header)
    unknown = set(sizes) - {HEADER, *(f"{name}.npy" for name in shapes)}
    if unknown:
        raise _no_estimator(path, f"it holds '{min(unknown)}', which no estimator has")
    if sum(sizes.values()) > MOST_BYTES:
        raise _no_estimator(path, "its content is larger than that of any estimator")
    arrays = {name: _read_array(archive, name, shape, path) for name, shape in shapes.items()}
    projection, network = _network(FIRST, header.network, arrays)
    whitening = Whitening(
        arrays["compared.units"], _single(arrays["compared.mean"]), _single(arrays["compared.basis"])
    )
    estimator = kind(
        _setup(header.setup, arrays["command_rad"], path),
        projection,
        network,
        ModelUpdate(whitening, *_network(UPDATE, header.update, arrays)),
        arrays["temperature"],
        ErrorPredictor(*_network(PREDICTOR, header.error_predictor, arrays)),
        Limits(
            arrays["limits.distances"],
            arrays["limits.ratios"],
            float(arrays["limits.predicted_error"][0]),
        ),
        header.facts,
    )
    if list(estimator.space.coordinates) != header.coordinates:
        raise _no_estimator(path, "its coordinates are not those of its actuator; train it again")
    return estimator


def _read_header(content: bytes, path: Path) -> _Header:
    try:
        values = json.loads(content)
    except (ValueError, RecursionError):
        raise _no_estimator(path, "its header is no JSON") from None
    found = values.get("format") if isinstance(values, dict) else None
    if isinstance(found, str) and found.startswith("emaphm estimator") and found != FORMAT:
        remedy = "update emaphm" if is_newer_format(found, FORMAT) else "train it again"
        raise MethodError(
            f"{path}: is of the format '{found[:40]}', this emaphm {VERSION} reads '{FORMAT}'; {remedy}"
        )
    try:
        return _Header.model_validate(values)
    except ValidationError as error:
        first = error.errors()[0]
        raise _no_estimator(path, f"'{'.'.join(map(str, first['loc']))}': {first['msg']}") from None


def _read_array(archive: zipfile.ZipFile, name: str, shape: tuple[int, ...], path: Path) -> Array:
    wanted = np.dtype(EXACT if name.rpartition(".")[2] in DOUBLE else WEIGHTS)
    size = wanted.itemsize * math.prod(shape)
    headers = {order: _array_header(wanted, shape, order) for order in ORDERS}
    try:
        member = archive.getinfo(f"{name}.npy")
    except KeyError:
        raise _no_estimator(path, f"'{name}' is missing") from None
    if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise _no_estimator(path, f"'{name}' is compressed in another way than ours")
    # The header that was written is compared, not read: one that is made up never is.
    fits = member.file_size in {len(header) + size for header in headers.values()}
    content = archive.read(member) if fits else b""
    order = next((one for one, header in headers.items() if content.startswith(header)), None)
    if order is None or len(content) != len(headers[order]) + size:
        raise _no_estimator(path, f"'{name}' has another shape or kind than the estimator's header says")
    values = np.frombuffer(content, wanted, offset=len(headers[order])).reshape(shape, order=order)
    if not np.all(np.isfinite(values)):
        raise _no_estimator(path, f"'{name}' is not finite")
    if name.rpartition(".")[2] in POSITIVE and not np.all(values > 0):
        raise _no_estimator(path, f"'{name}' is not above 0")
    if name.startswith("limits.") and not np.all(values >= 0):
        raise _no_estimator(path, f"'{name}' is below 0")
    return np.asarray(values)


def _array_header(kind: np.dtype[Any], shape: tuple[int, ...], order: Literal["C", "F"]) -> bytes:
    """Return what NumPy writes before the numbers of an array, by rows or by columns."""
    begin = io.BytesIO()
    about = {"descr": kind.str, "fortran_order": order == "F", "shape": shape}
    np.lib.format.write_array_header_1_0(begin, about)
    return begin.getvalue()


def _network(of: str, header: _Network, arrays: dict[str, Array]) -> tuple[Projection, Network]:
    """Return the projection and the network named `of`."""

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
    return projection, Network(
        projection.layer,
        dense("entry"),
        blocks,
        norm("norm"),
        dense("exit"),
        arrays[f"{of}.deviations"],
        header.components,
    )


def _setup(header: _Setup, command: Array, path: Path) -> RecordingSetup:
    try:
        actuator = Actuator.from_dict(header.actuator, where=str(path))
    except ActuatorError as error:
        raise MethodError(f"{error}; {DAMAGED_OR_OTHER}") from None
    if header.sampling != actuator.channels.sampling:
        raise _no_estimator(path, "its rows are not as its actuator's channels say")
    if header.channels[0] != "current_A" or len({*header.channels}) < len(header.channels):
        raise _no_estimator(path, "its channels are not the current first, and each once")
    setup = RecordingSetup(
        actuator,
        command,
        header.interval_s,
        header.sampling,
        tuple(header.channels),
        header.noise,
        header.adc_bits,
        None if header.nuisances is None else tuple(header.nuisances),
        header.initial_position,
    )
    try:
        check_channels(actuator, setup.channels)
        _ = setup.space  # made here, for what it refuses
    except MethodError as error:
        raise MethodError(f"{path}: {error}; {DAMAGED_OR_OTHER}") from None
    return setup


def _single(values: Array) -> Any:
    return values.astype(np.float32)


def _no_estimator(path: Path, why: str) -> MethodError:
    return MethodError(f"{path}: is no estimator, or damaged ({why}); write one with 'emaphm train'")
