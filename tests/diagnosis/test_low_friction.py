"""Friction below healthy, as of a lost preload: estimates and reports; methods of the thesis stop at 0."""

import json

import numpy as np
import pytest

from cases import THESIS
from emaphm.actuator import Actuator, Chirp, Faults
from emaphm.diagnosis import Diagnosis, diagnose
from emaphm.plotting.fault_intervals import draw_faults
from emaphm.plotting.posterior import draw_posterior
from emaphm.recording import Recording, acquire
from emaphm.report.wording import component_table, headline
from emaphm.simulated_recording import simulate
from emaphm.simulation import AVERAGED

FACTORS = (pytest.param(0.3, marks=pytest.mark.evidence), 0.7)
KEPT = ("time_s", "command_rad", "current_A", "voltage_V")


def recorded(faults: Faults, seed: int = 0, *, duration: float = 0.2) -> Recording:
    command = Chirp(duration=duration)
    whole = simulate(THESIS, command, faults=faults, duration=duration, noise=0.05, adc_bits=12, seed=seed)
    return Recording({name: whole[name] for name in KEPT})


@pytest.fixture(scope="module", params=FACTORS)
def factor(request: pytest.FixtureRequest) -> float:
    return float(request.param)


@pytest.fixture(scope="module")
def diagnosis(factor: float) -> Diagnosis:
    return diagnose(recorded(Faults(friction=(factor - 1) / 2)), THESIS, workers=1)


def test_low_friction_is_estimated_within_its_interval_without_other_faults(
    diagnosis: Diagnosis, factor: float
) -> None:
    friction = diagnosis.components["friction"]
    assert diagnosis.explained
    low, high = friction.interval95
    assert low <= (factor - 1) / 2 <= high
    # Of the order of the published errors, with a median of 0.4 % over all components.
    assert high - low < 0.01
    assert {name for name, one in diagnosis.components.items() if one.verdict == "degraded"} == {"friction"}


def test_low_friction_is_reported_in_table_report_and_json(diagnosis: Diagnosis, factor: float) -> None:
    words = f"dry friction × {diagnosis.faults.physical(THESIS)['friction_factor']:.3f}, below healthy"
    assert float(words.split()[3].rstrip(",")) == pytest.approx(factor, abs=0.01)
    assert words in str(diagnosis)
    assert words in component_table(diagnosis, None).rows[0]
    assert words in " ".join(headline(diagnosis).sentences)
    read = json.loads(diagnosis.to_json())
    assert read["faults"]["friction"]["value"] < 0
    assert Faults.from_vector(read["k"]).friction == read["k"][0] < 0


def test_the_interval_of_low_friction_is_on_the_axis(diagnosis: Diagnosis) -> None:
    axis = draw_faults(diagnosis).axes[0]
    low, high = diagnosis.interval["friction"]
    assert axis.get_xlim()[0] < low
    assert [low, high] in [list(np.asarray(line.get_xdata())) for line in axis.get_lines()]


def test_the_posterior_of_low_friction_agrees_with_its_interval() -> None:
    # Only three faults, and a recording of the fitted model itself: the chain converges quickly.
    ideal = Actuator.from_dict(THESIS.model_dump() | {"electrical": None})
    whole = simulate(
        ideal,
        Chirp(duration=0.1),
        faults=Faults(friction=-0.15),
        model="averaged",
        sampling="instant",
        sample_rate=1 / AVERAGED.step,
        duration=0.1,
    )
    kept = Recording({name: whole[name] for name in KEPT[:3]}, "instant")
    recording = acquire(kept, noise={"current_A": 0.3}, seed=0)
    diagnosis = diagnose(recording, ideal, workers=1, nuisances=(), posterior=True)
    assert diagnosis.posterior is not None
    assert diagnosis.posterior.interval95["friction"] == pytest.approx(
        diagnosis.interval["friction"], abs=2e-3
    )
    assert draw_posterior(diagnosis).axes[0].get_xlim()[1] < 0


def test_a_method_of_the_thesis_does_not_search_below_healthy() -> None:
    diagnosis = diagnose(recorded(Faults(friction=-0.3), duration=0.1), THESIS, method="de", workers=1)
    assert diagnosis.faults.friction >= 0
    assert diagnosis.interval["friction"][0] >= 0
