"""Diagnosis as stored in a history."""

import json
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from emaphm.actuator.faults import CARTESIAN_NAMES, Faults, to_cartesian
from emaphm.arrays import Array
from emaphm.history.records import Flight

if TYPE_CHECKING:
    from emaphm.diagnosis import Diagnosis


@dataclass(frozen=True)
class KeptSettings:
    """Inputs of a diagnosis apart from the recording; `description` is the SHA-256 of the actuator's TOML."""

    description: str
    method: str = "hybrid"
    model: str = "averaged"
    fitness: str = "least_squares"
    seed: int = 0

    @classmethod
    def of(cls, diagnosis: "Diagnosis", description: str) -> "KeptSettings":
        """Return the settings of `diagnosis`."""
        return cls(description, diagnosis.method, diagnosis.model, diagnosis.fitness_name, diagnosis.seed)


@dataclass(frozen=True, eq=False)
class KeptDiagnosis:
    """A diagnosis as stored in the history.

    Attributes
    ----------
    flight
        Hours [h], cycles and position at the recording.
    recording_hash, recording
        SHA-256 of the recording's channels, and the name under which it was added.
    vector, standard_errors
        The eight components in the order of `Faults`, each (8,), normalised.
    explained
        Whether the diagnosis is explained; if not, its estimates are not used.
    coordinates, covariance
        Names (d,) of the estimator's coordinates (those of `CARTESIAN_NAMES` that the actuator has, then
        nuisances), and their full covariance (d, d).
    settings, version
        Settings of the diagnosis, and version of emaphm.
    added_at
        Time of the entry, UTC, ISO 8601.
    text
        The remaining output of `emaphm diagnose --json`, as JSON.
    """

    flight: Flight
    recording_hash: str
    recording: str
    vector: Array
    standard_errors: Array
    explained: bool
    coordinates: tuple[str, ...]
    covariance: Array
    settings: KeptSettings
    version: str
    added_at: str
    text: str = field(repr=False)

    @property
    def hours(self) -> float:
        """Flight hours of the unit at the recording [h]."""
        return self.flight.hours

    @property
    def faults(self) -> Faults:
        """The estimated faults."""
        return Faults.from_vector(self.vector)

    @cached_property
    def document(self) -> dict[str, Any]:
        """The output of `emaphm diagnose --json`, including the covariance."""
        matrix = {"coordinates": list(self.coordinates), "matrix": self.covariance.tolist()}
        return {**json.loads(self.text), "covariance": matrix}

    @cached_property
    def verdicts(self) -> dict[str, str]:
        """The verdict on each component: "healthy", "degraded" or "cannot tell"."""
        return {name: fault["verdict"] for name, fault in self.document["faults"].items()}

    @property
    def estimated_load(self) -> float | None:
        """The constant load that was estimated with the faults, in its unit; None if it was not estimated."""
        load = self.document["nuisances"].get("load")
        return None if load is None else float(load["value"])

    @property
    def cartesian(self) -> Array:
        """The estimate in the coordinates `CARTESIAN_NAMES`, shape (8,): the eccentricity as a vector."""
        return np.asarray(to_cartesian(self.vector))

    @property
    def cartesian_covariance(self) -> Array:
        """The covariance of `cartesian`, shape (8, 8), marginalised over the nuisances.

        A component that the actuator does not have has its prior variance, and no covariance.
        """
        variances = self.standard_errors**2
        variances[6] = variances[5]  # both directions of an eccentricity that the actuator does not have
        result = np.diag(variances)
        rows = self._present_rows
        places = [self.coordinates.index(CARTESIAN_NAMES[i]) for i in rows]
        result[np.ix_(rows, rows)] = self.covariance[np.ix_(places, places)]
        return result

    @property
    def cartesian_shared_covariance(self) -> Array:
        """The shared covariance of all recordings of the unit, a part of `cartesian_covariance`, (8, 8)."""
        result = np.zeros((len(CARTESIAN_NAMES), len(CARTESIAN_NAMES)))
        if '"shared_covariance"' in self.text:  # parsing all of the text takes a hundred times as long
            result[np.ix_(self._present_rows, self._present_rows)] = json.loads(self.text)[
                "shared_covariance"
            ]
        return result

    @property
    def _present_rows(self) -> list[int]:
        """Indices in `CARTESIAN_NAMES` of the components that the actuator has."""
        return [i for i, name in enumerate(CARTESIAN_NAMES) if name in self.coordinates]
