"""Synthetic recordings and diagnoses, different for each number and reproducible."""

import numpy as np

from emaphm.actuator import NAMES, Actuator, Faults
from emaphm.actuator.faults import CARTESIAN_NAMES, to_cartesian
from emaphm.diagnosis import Diagnosis, Estimate
from emaphm.diagnosis.nuisance_estimate import NuisanceEstimate
from emaphm.history import Entry
from emaphm.recording import Recording
from emaphm.version import VERSION

THESIS = Actuator.thesis()
PART = THESIS.name


def recording(number: int) -> Recording:
    """Return a recording of 0.2 s at 1 kHz that is unique to its number."""
    time = np.arange(200) / 1e3
    swing = 2 * np.pi * 10.0 * time
    command = 5e-3 * np.sin(swing)
    current = 1.5 * np.sign(np.cos(swing)) + 1e-3 * number
    return Recording({"time_s": time, "command_rad": command, "current_A": current}, source=f"{number}.csv")


def diagnosis(
    number: int, *, explained: bool = True, actuator: Actuator = THESIS, seed: int = 0
) -> Diagnosis:
    """Return a diagnosis with values, and a covariance without zeros, that are unique to its number."""
    random = np.random.default_rng(number)
    vector = 0.2 + 0.6 * random.random(8)
    coordinates = (*CARTESIAN_NAMES, "load", "temperature")
    root = 0.01 * random.standard_normal((10, 12))
    covariance = root @ root.T
    errors = np.sqrt(np.diag(covariance))
    components = {
        name: Estimate(
            float(value),
            float(error),
            (float(value - 1.96 * error), float(value + 1.96 * error)),
            identifiable=True,
            verdict="degraded" if explained else "cannot tell",
        )
        for name, value, error in zip(NAMES, vector, errors[:8], strict=True)
    }
    held = recording(number)
    return Diagnosis(
        components=components,
        coordinates=coordinates,
        covariance=covariance,
        method="hybrid",
        model="averaged",
        fitness_name="least_squares",
        fitness=0.01,
        residual_rms_A=0.05,
        explained=explained,
        evaluations=1000,
        reference_runs=30,
        seconds=0.3,
        seed=seed,
        recording=held.source,
        actuator=actuator,
        version=VERSION,
        time_s=held["time_s"],
        recorded=held["current_A"],
        modelled=held["current_A"],
        nuisances={"load": NuisanceEstimate(0.01, 0.001, "N·m", known=True)},
        recording_notes=("rows were resampled",),
    )


def cartesian(number: int) -> np.ndarray:
    """Return the estimate of `diagnosis` in the estimator's coordinates, shape (8,)."""
    return np.asarray(to_cartesian(diagnosis(number).faults.vector))


def entry(unit: str = "S1", hours: float = 10.0, *, late: bool = False, part: str = PART) -> Entry:
    return Entry(unit, part, hours, late=late)


HEALTHY = Faults().vector
