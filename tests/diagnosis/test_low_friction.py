"""Friction below healthy, as of a lost preload: found, sized, said, drawn; the thesis's methods stop at 0."""

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
def found(factor: float) -> Diagnosis:
    return diagnose(recorded(Faults(friction=(factor - 1) / 2)), THESIS, workers=1)


def test_it_is_found_within_its_interval_and_nothing_else_is(found: Diagnosis, factor: float) -> None:
    friction = found.components["friction"]
    assert found.explained
    low, high = friction.interval95
    assert low <= (factor - 1) / 2 <= high
    # Of the order of the published errors, 0.4 % in the median over all components together.
    assert high - low < 0.01
    assert {name for name, one in found.components.items() if one.verdict == "degraded"} == {"friction"}


def test_it_is_said_in_the_table_the_report_and_the_json(found: Diagnosis, factor: float) -> None:
    words = f"dry friction × {found.faults.physical(THESIS)['friction_factor']:.3f}, below healthy"
    assert float(words.split()[3].rstrip(",")) == pytest.approx(factor, abs=0.01)
    assert words in str(found)
    assert words in component_table(found, None).rows[0]
    assert words in " ".join(headline(found).sentences)
    read = json.loads(found.to_json())
    assert read["faults"]["friction"]["value"] < 0
    assert Faults.from_vector(read["k"]).friction == read["k"][0] < 0


def test_its_interval_is_on_the_axis(found: Diagnosis) -> None:
    axis = draw_faults(found).axes[0]
    low, high = found.interval["friction"]
    assert axis.get_xlim()[0] < low
    assert [low, high] in [list(np.asarray(line.get_xdata())) for line in axis.get_lines()]


def test_the_posterior_agrees() -> None:
    # Of three faults alone, and what the fitted model makes itself: the chain is soon done.
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


def test_a_method_of_the_thesis_searches_from_healthy_up() -> None:
    ended = diagnose(recorded(Faults(friction=-0.3), duration=0.1), THESIS, method="de", workers=1)
    assert ended.faults.friction >= 0
    assert ended.interval["friction"][0] >= 0
