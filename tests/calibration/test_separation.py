"""Collinear parameters: reported sets, and advised manoeuvres and channels to separate them."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cases import THESIS
from emaphm.actuator import Actuator, Ramp
from emaphm.actuator.lumped_parameters import with_lumped_parameters
from emaphm.calibration import calibrate, separation
from emaphm.estimation.space.parameter_variation import ParameterVariation
from emaphm.recording import Recording
from emaphm.simulated_recording import simulate
from emaphm.simulation import Initial

NAMES = ("viscous", "coulomb", "offset")
COULOMB = 0.02
"""Coulomb friction of the calibrated actuator, at the motor [N·m]."""


def fit(description: Actuator, errors: tuple[float, float, float]) -> Any:
    """Return the result of a fit that started from `description`.

    `errors` are standard errors of the parameters: of the logarithm of the first two, of the third [N·m].
    """
    alike = np.full((3, 3), 0.99) + 0.01 * np.eye(3)
    unit = ParameterVariation.free(description, NAMES)
    inverse = np.linalg.inv(unit.axes)
    covariance = inverse @ (np.outer(errors, errors) * alike) @ inverse.T
    return SimpleNamespace(
        fitted=NAMES,
        joint=SimpleNamespace(shared=3, terms=(), unit=unit),
        uncertainty=SimpleNamespace(covariance=covariance),
    )


@pytest.mark.parametrize("factor", [0.5, 1.0, 3.0])
@pytest.mark.parametrize(("offset", "is_reported"), [(0.014, False), (0.03, True)])
def test_collinear_sets_do_not_depend_on_the_starting_description(
    factor: float, offset: float, is_reported: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(separation, "_channel_information", lambda *_: {})
    monkeypatch.setattr(separation, "_manoeuvre_information", lambda *_: {})
    calibrated = with_lumped_parameters(THESIS, {"coulomb": COULOMB})
    started = with_lumped_parameters(THESIS, {"coulomb": factor * COULOMB})
    # The error of the offset is relative to the estimated friction, for any described friction.
    groups = separation.collinear_parameters(
        fit(started, (0.018, 0.018, offset * COULOMB)), calibrated, seed=0
    )
    assert [group.members for group in groups] == [NAMES] * is_reported


def recorded_from(
    start: float, command: list[float], coordinates: str = "rotary", stops: tuple[float, float] | None = None
) -> Any:
    """Return the properties of a recording that began at rest at `start`, between end stops."""
    mechanics = THESIS.mechanics.model_copy(update={"end_stops": stops})
    problem = SimpleNamespace(
        actuator=SimpleNamespace(coordinates=coordinates, mechanics=mechanics),
        inputs=SimpleNamespace(command=np.array(command), interval=1e-3, sampling="instant"),
        start=Initial(start / mechanics.gear_ratio),
        duration_s=2.0,
    )
    return SimpleNamespace(terms=[SimpleNamespace(objective=SimpleNamespace(problem=problem))])


def test_advised_manoeuvres_are_within_the_range_of_the_recorded_one() -> None:
    # The amplitude is the recorded distance from the start; near a stop, the recorded range is used.
    for stops, size, about in ((None, 0.3, 0.1), ((0.0, 1.0), 0.15, 0.25)):
        manoeuvres = separation._manoeuvres(recorded_from(0.1, [0.1, 0.4], stops=stops))
        slow, ramp, chirp = manoeuvres
        assert f"{size:g} rad about {about:g} rad at" in slow
        assert f"{size:g} rad about {about:g} rad up to" in chirp
        assert f"from {about:g} to {about + size:g} rad in 2 s" in ramp
        for driving in manoeuvres.values():
            assert driving.command(np.zeros(1)) == pytest.approx(about)
            farthest = np.abs(driving.command(np.linspace(0.0, 2.0, 2001)) - about).max()
            assert farthest == pytest.approx(size, rel=1e-3)


@pytest.mark.parametrize(("coordinates", "unit"), [("linear", "m"), ("rotary", "rad")])
def test_advised_manoeuvres_have_units(coordinates: str, unit: str) -> None:
    slow, ramp, chirp = separation._manoeuvres(recorded_from(0.0, [0.0, -0.246], coordinates))
    assert f"0.246 {unit} at 0.5 Hz" in slow
    assert f"0.246 {unit} in 2 s" in ramp
    assert f"0.246 {unit} up to 10 Hz" in chirp


@pytest.mark.parametrize(
    ("recorded", "free"),
    [
        # The current along the flux is controlled to 0; the current across it is the equivalent current.
        ("current_A", ("viscous", "coulomb", "offset")),
        ("current_q_A", ("inertia", "viscous", "coulomb")),
    ],
)
def test_a_current_equal_to_the_recorded_one_or_0_is_not_advised(
    recorded: str, free: tuple[str, ...]
) -> None:
    pmsm = Actuator.pmsm()
    whole = simulate(pmsm, Ramp(0.2), model="averaged", noise=0.3)
    kept = {name: whole[name] for name in ("time_s", "command_rad", recorded)}
    calibration = calibrate(
        Recording(kept, whole.sampling), pmsm, free, nuisances=(), max_corrections=0, workers=1
    )
    assert calibration.collinear_sets
    for group in calibration.collinear_sets:
        assert not {"current_A", "current_q_A", "current_d_A"} & set(group.channels)
