"""File of an estimator: a zip archive of a JSON header and plain arrays, without executable content.

The name, number type and shape of each member are known before it is read, and so is the size of the archive.
"""

import io
import json
import zipfile
import zlib
from pathlib import Path
from typing import TypeVar

import numpy as np

from emaphm.amortized.content import EstimatorContent, Limits
from emaphm.amortized.error_prediction.predictor import ErrorPredictor
from emaphm.amortized.model_update import ModelUpdate
from emaphm.amortized.storage.arrays import (
    FIRST,
    PREDICTOR,
    UPDATE,
    arrays_of,
    kind_of,
    network_of,
    read_array,
    shapes_of,
    whitening_of,
)
from emaphm.amortized.storage.header import header_of, no_estimator, read_header, setup_of
from emaphm.errors import MethodError
from emaphm.input_files import checked_size
from emaphm.output_files import written_whole

Content = TypeVar("Content", bound=EstimatorContent)

HEADER = "header.json"

MOST_BYTES = 64 * 2**20
"""Largest file, and largest content, that is read [bytes]; with the default network, a file has 8 MB."""

MOST_HEADER_BYTES = 4 * 2**20

DAMAGED = (
    zipfile.BadZipFile,
    zlib.error,
    OSError,
    ValueError,
    EOFError,
    NotImplementedError,
    RuntimeError,
)
"""Errors that reading a damaged zip archive raises."""


def write_estimator(estimator: EstimatorContent, path: str | Path) -> None:
    """Write an estimator to one file; `OutputError` if it cannot be written."""
    header = header_of(estimator)
    with written_whole(path) as temporary, zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(HEADER, json.dumps(header.model_dump(), indent=1, allow_nan=False))
        for name, values in arrays_of(estimator).items():
            buffer = io.BytesIO()
            np.lib.format.write_array(buffer, values.astype(kind_of(name)), allow_pickle=False)
            archive.writestr(f"{name}.npy", buffer.getvalue())


def read_estimator(path: Path, kind: type[Content]) -> Content:
    """Return the estimator in a file, as an object of the class `kind`; errors as in `Estimator.load`."""
    checked_size(path, MOST_BYTES, MethodError)
    try:
        with zipfile.ZipFile(path) as archive:
            return _estimator(archive, path, kind)
    except DAMAGED as error:
        if isinstance(error, MethodError):
            raise
        raise no_estimator(path, " ".join(str(error).split())) from None


def _estimator(archive: zipfile.ZipFile, path: Path, kind: type[Content]) -> Content:
    sizes = {member.filename: member.file_size for member in archive.infolist()}
    if HEADER not in sizes or sizes[HEADER] > MOST_HEADER_BYTES:
        raise no_estimator(path, f"it has no {HEADER}")
    header = read_header(archive.read(HEADER), path)
    shapes = shapes_of(header)
    unknown = set(sizes) - {HEADER, *(f"{name}.npy" for name in shapes)}
    if unknown:
        raise no_estimator(path, f"it holds '{min(unknown)}', which no estimator has")
    if sum(sizes.values()) > MOST_BYTES:
        raise no_estimator(path, "its content is larger than that of any estimator")
    arrays = {name: read_array(archive, name, shape, path) for name, shape in shapes.items()}
    estimator = kind(
        setup_of(header.setup, arrays["command_rad"], path),
        network_of(FIRST, header.network, arrays),
        ModelUpdate(whitening_of(arrays), network_of(UPDATE, header.update, arrays)),
        arrays["temperature"],
        ErrorPredictor(network_of(PREDICTOR, header.error_predictor, arrays)),
        Limits(
            arrays["limits.distances"],
            arrays["limits.ratios"],
            float(arrays["limits.predicted_error"][0]),
        ),
        header.facts,
    )
    if list(estimator.space.coordinates) != header.coordinates:
        raise no_estimator(path, "its coordinates are not those of its actuator; train it again")
    return estimator
