"""Diagnoses with given values: their content is known, and no simulation is needed."""

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest

from emaphm.actuator import Actuator, Faults
from emaphm.diagnosis import Diagnosis, Estimate

LACKING = "needs an electrical description, which the actuator lacks"


def _known(value: float, half: float, verdict: Literal["healthy", "degraded"]) -> Estimate:
    interval = (value - half, value + half)
    return Estimate(value, half / 1.96, interval, identifiable=True, verdict=verdict)


@pytest.fixture(scope="session")
def truth() -> Faults:
    return Faults(
        friction=0.26, backlash=0.3, short_b=0.4, eccentricity=0.3, eccentricity_phase=0.99, gain=0.6
    )


@pytest.fixture(scope="session")
def faulty() -> Diagnosis:
    """Return a diagnosis of a faulty thesis actuator; the interval of the direction passes 1."""
    time = np.arange(500) / 1e3
    modelled = 3 * np.sin(40 * time)
    recorded = modelled + np.random.default_rng(0).normal(0, 0.1, time.size)
    recorded[300:320] += 0.5
    components = {
        "friction": _known(0.25, 0.02, "degraded"),
        "backlash": _known(0.3111, 0.03, "degraded"),
        "short_a": Estimate(0.001, 0.002, (0.0, 0.005), identifiable=True, verdict="healthy"),
        "short_b": _known(0.41, 0.02, "degraded"),
        "short_c": Estimate(0.0, 0.002, (0.0, 0.004), identifiable=True, verdict="healthy"),
        "eccentricity": _known(0.3, 0.04, "degraded"),
        "eccentricity_phase": _known(0.98, 0.05, "degraded"),
        "gain": _known(0.6, 0.002, "degraded"),
    }
    return Diagnosis(
        components=components,
        coordinates=("friction",),
        covariance=np.eye(1),
        method="hybrid",
        model="averaged",
        fitness_name="least_squares",
        fitness=0.01234,
        residual_rms_A=float(np.sqrt(np.mean((recorded - modelled) ** 2))),
        explained=True,
        evaluations=940,
        reference_runs=4,
        seconds=1.25,
        seed=17,
        recording="rig/run 3.csv",
        actuator=Actuator.thesis(),
        version="9.8.7",
        time_s=time,
        recorded=recorded,
        modelled=modelled,
    )


@pytest.fixture(scope="session")
def linear(faulty: Diagnosis) -> Diagnosis:
    """Return a diagnosis of a healthy linear actuator, most components of which are inconclusive."""
    actuator = Actuator.thesis().model_copy(update={"coordinates": "linear", "electrical": None})
    unknown = Estimate(0.0, 0.3, (0.0, 1.0), identifiable=False, verdict="cannot tell", reason=LACKING)
    components = dict.fromkeys(faulty.components, unknown)
    components["friction"] = _known(0.01, 0.01, "healthy")
    components["backlash"] = _known(0.02, 0.02, "healthy")
    components["gain"] = _known(0.5, 0.01, "healthy")
    return replace(faulty, actuator=actuator, components=components, reference_runs=0)
