"""The header of an estimator's file, as JSON: the setup, the sizes of the networks, and training facts."""

import json
import platform
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from emaphm.actuator import Actuator
from emaphm.actuator.channels import Sampling
from emaphm.actuator.section import LARGEST, SMALLEST
from emaphm.amortized.content import EstimatorContent
from emaphm.amortized.networks.network import Network
from emaphm.amortized.recording_setup import MOST_ROWS, RecordingSetup, check_channels
from emaphm.arrays import Array
from emaphm.errors import ActuatorError, MethodError
from emaphm.input_files import is_newer_format
from emaphm.version import VERSION

FORMAT = "emaphm estimator 4"

WIDEST, DEEPEST, MOST_COMPONENTS = 4096, 32, 32

DAMAGED_OR_OTHER = (
    "the file is damaged or of another version of emaphm; update it if that is a newer one, else train again"
)

Size = Annotated[int, Field(ge=1, le=WIDEST)]


class SetupHeader(BaseModel):
    """A `RecordingSetup` without its command, which is stored as an array."""

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


class NetworkHeader(BaseModel):
    """The sizes of a network: `principal` inputs, and a mixture of `components` as output."""

    model_config = ConfigDict(extra="forbid")

    principal: Size
    width: Size
    depth: Annotated[int, Field(ge=1, le=DEEPEST)]
    components: Annotated[int, Field(ge=1, le=MOST_COMPONENTS)]

    @classmethod
    def of(cls, network: Network) -> "NetworkHeader":
        """Return the sizes of `network`."""
        principal, width = network.entry.weight.shape
        return cls(principal=principal, width=width, depth=len(network.blocks), components=network.components)


class Header(BaseModel):
    """The content of the header; `compared` is the length of the whitened residual (`Whitening.basis`)."""

    model_config = ConfigDict(extra="forbid")

    format: Literal["emaphm estimator 4"]
    version: str
    setup: SetupHeader
    coordinates: Annotated[list[str], Field(min_length=1, max_length=128)]
    network: NetworkHeader
    update: NetworkHeader
    error_predictor: NetworkHeader
    compared: Size
    facts: dict[str, Any]


def header_of(content: EstimatorContent) -> Header:
    """Return the header of an estimator's file."""
    setup, update = content.setup, content.update
    return Header(
        format=FORMAT,
        version=VERSION,
        setup=SetupHeader(
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
        coordinates=list(content.space.coordinates),
        network=NetworkHeader.of(content.network),
        update=NetworkHeader.of(update.network),
        error_predictor=NetworkHeader.of(content.error_predictor.network),
        compared=update.whitening.basis.shape[1],
        facts={
            **content.facts,
            "actuator_hash": content.actuator_hash,
            "python": platform.python_version(),
        },
    )


def read_header(content: bytes, path: Path) -> Header:
    """Return the header of the file at `path`; `MethodError` if it is no header of an estimator."""
    try:
        values = json.loads(content)
    except (ValueError, RecursionError):
        raise no_estimator(path, "its header is no JSON") from None
    form = values.get("format") if isinstance(values, dict) else None
    if isinstance(form, str) and form.startswith("emaphm estimator") and form != FORMAT:
        remedy = "update emaphm" if is_newer_format(form, FORMAT) else "train it again"
        raise MethodError(
            f"{path}: is of the format '{form[:40]}', this emaphm {VERSION} reads '{FORMAT}'; {remedy}"
        )
    try:
        return Header.model_validate(values)
    except ValidationError as error:
        first = error.errors()[0]
        raise no_estimator(path, f"'{'.'.join(map(str, first['loc']))}': {first['msg']}") from None


def setup_of(header: SetupHeader, command: Array, path: Path) -> RecordingSetup:
    """Return the setup of a header, with its command (rows,); `MethodError` if it is invalid."""
    try:
        actuator = Actuator.from_dict(header.actuator, where=str(path))
    except ActuatorError as error:
        raise MethodError(f"{error}; {DAMAGED_OR_OTHER}") from None
    if header.sampling != actuator.channels.sampling:
        raise no_estimator(path, "its sampling differs from that of its actuator's channels")
    if header.channels[0] != "current_A" or len({*header.channels}) < len(header.channels):
        raise no_estimator(path, "its channels do not begin with the current, or one occurs twice")
    setup = RecordingSetup(
        actuator=actuator,
        command_rad=command,
        interval_s=header.interval_s,
        sampling=header.sampling,
        channels=tuple(header.channels),
        noise=header.noise,
        adc_bits=header.adc_bits,
        nuisances=None if header.nuisances is None else tuple(header.nuisances),
        initial_position=header.initial_position,
    )
    try:
        check_channels(actuator, setup.channels)
        _ = setup.space  # evaluated here, because it raises for unknown nuisances
    except MethodError as error:
        raise MethodError(f"{path}: {error}; {DAMAGED_OR_OTHER}") from None
    return setup


def no_estimator(path: Path, why: str) -> MethodError:
    """Return the error for a file that holds no estimator; `why` is the reason."""
    return MethodError(f"{path}: is no estimator, or damaged ({why}); write one with 'emaphm train'")
