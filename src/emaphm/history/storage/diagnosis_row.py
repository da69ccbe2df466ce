"""Conversion of a diagnosis to a row of the table of diagnoses, and back."""

import json
from typing import TYPE_CHECKING, Any

import numpy as np

from emaphm.actuator.faults import NAMES
from emaphm.arrays import Array
from emaphm.history.kept_diagnosis import KeptDiagnosis, KeptSettings
from emaphm.history.records import Flight
from emaphm.strict_json import finite

if TYPE_CHECKING:
    import sqlalchemy as sa

    from emaphm.diagnosis import Diagnosis

NUMBER = "<f8"
"""Format of arrays in the database: little-endian double precision, on any machine."""


def row_of(diagnosis: "Diagnosis") -> dict[str, Any]:
    """Return the values of a diagnosis in a row of `DIAGNOSES`."""
    document = finite(diagnosis.to_dict())
    del document["covariance"]  # stored in separate columns, in a quarter of the space
    return {
        "method": diagnosis.method,
        "model": diagnosis.model,
        "fitness": diagnosis.fitness_name,
        "seed": str(diagnosis.seed),
        "version": diagnosis.version,
        "explained": bool(diagnosis.explained),
        "vector": _packed(diagnosis.faults.vector),
        "standard_errors": _packed([diagnosis.components[name].standard_error for name in NAMES]),
        "coordinates": json.dumps(list(diagnosis.coordinates)),
        "covariance": _packed(diagnosis.covariance),
        "document": json.dumps(document),
    }


def diagnosis_of(row: "sa.Row[Any]", flight: Flight) -> KeptDiagnosis:
    """Return the diagnosis of a row of `reading.diagnoses`."""
    coordinates = tuple(json.loads(row.coordinates))
    return KeptDiagnosis(
        flight=flight,
        recording_hash=row.recording_hash,
        recording=row.recording_name,
        vector=unpacked(row.vector),
        standard_errors=unpacked(row.standard_errors),
        explained=row.explained,
        coordinates=coordinates,
        covariance=unpacked(row.covariance).reshape(len(coordinates), len(coordinates)),
        settings=KeptSettings(row.description_hash, row.method, row.model, row.fitness, int(row.seed)),
        version=row.version,
        added_at=row.added_at,
        text=row.document,
    )


def _packed(values: Any) -> bytes:
    return np.asarray(values, NUMBER).tobytes()


def unpacked(content: bytes) -> Array:
    """Return the array (n,) that a column contains."""
    return np.frombuffer(content, NUMBER).astype(float)
