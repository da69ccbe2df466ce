"""Selection of laws by the error in held-out recordings, and estimation of their parameters."""

from collections.abc import Mapping, Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cases import THESIS
from emaphm.actuator import Actuator, Chirp, Command
from emaphm.actuator.laws import LAWS, Law
from emaphm.actuator.laws.calibrated import laws_to_calibrate
from emaphm.actuator.lumped_parameters import with_lumped_parameters
from emaphm.calibration import Calibration, calibrate, description, law_selection
from emaphm.calibration.unit_fit import FitSettings
from emaphm.errors import MethodError
from emaphm.recording import Recording, acquire
from emaphm.simulated_recording import simulate

pytestmark = pytest.mark.usefixtures("no_model_error")

FREE = ("inertia", "viscous", "coulomb")
STRIBECK = with_lumped_parameters(
    LAWS["stribeck"].added_to(THESIS, 60.0),
    {"inertia": 2.7e-5, "coulomb": 0.075, "static": 0.14, "stribeck_speed": 20.0},
)
COMMANDS: tuple[Command, ...] = (Chirp(duration=0.2), Chirp(stop_hz=8.0, duration=0.2))


def recordings_of(actuator: Actuator) -> list[Recording]:
    days = []
    for seed, command in enumerate(COMMANDS):
        whole = simulate(actuator, command, model="averaged", duration=0.2)
        kept = {name: whole[name] for name in ("time_s", "command_rad", "current_A", "position_rad")}
        noise = {"current_A": 0.05, "position_rad": 2e-5}
        days.append(acquire(Recording(kept, whole.sampling, f"day {seed}"), noise=noise, seed=seed))
    return days


@pytest.fixture
def few_laws(monkeypatch: pytest.MonkeyPatch) -> None:
    """Restrict the choice to three laws: each law and each pair requires the compilation of its kernels."""
    few = (LAWS["stribeck"], LAWS["directional"], LAWS["presliding"])
    monkeypatch.setattr(description, "laws_to_calibrate", lambda _: few)


def calibrated(
    actuator: Actuator, laws: str | list[str], free: tuple[str, ...] | None = FREE, *, days: int = 2
) -> Calibration:
    recordings = recordings_of(actuator)[:days]
    return calibrate(recordings, THESIS, free, laws=laws, nuisances=(), max_corrections=0, workers=1)


@pytest.mark.usefixtures("few_laws")
def test_the_law_of_the_machine_is_chosen_and_no_other() -> None:
    calibration = calibrated(STRIBECK, "auto")
    assert calibration.laws == ("stribeck",)
    assert calibration.parameters["stribeck_speed"].value == pytest.approx(20.0, rel=0.05)
    assert calibration.parameters["static"].value == pytest.approx(0.14, rel=0.02)
    assert calibration.parameters["coulomb"].value == pytest.approx(0.075, rel=0.02)
    assert calibration.actuator.friction is not None
    assert calibration.actuator.friction.stribeck_speed == calibration.parameters["stribeck_speed"].value
    trials = calibration.to_dict()["selection"]
    assert [trial["law"] for trial in trials[:4]] == ["none", "stribeck", "directional", "presliding"]
    assert [trial["law"] for trial in trials if trial["chosen"]] == ["none", "stribeck"]
    none, stribeck = trials[0], next(trial for trial in trials if trial["law"] == "stribeck")
    assert stribeck["held_out_error"] < 0.5 * none["held_out_error"]
    # The error in held-out data is no smaller than that in the fitted data.
    assert none["held_out_error"] >= 0.99 * none["training_error"]
    assert all(trial["seconds"] > 0 and trial["evaluations"] > 0 for trial in trials)
    # Bristles, which require a Stribeck speed, must reduce the error more than that speed alone.
    for further in ("directional", "presliding"):
        assert f"stribeck + {further}" in str(calibration)


@pytest.mark.usefixtures("few_laws")
def test_no_law_is_chosen_for_a_machine_without_further_laws() -> None:
    calibration = calibrated(with_lumped_parameters(THESIS, {"inertia": 2.7e-5, "coulomb": 0.075}), "auto")
    assert calibration.laws == ()
    assert calibration.parameters["inertia"].value == pytest.approx(2.7e-5, rel=0.01)
    assert calibration.actuator.friction == THESIS.friction


def test_bristles_are_evaluated_with_the_stribeck_speed_that_they_require(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # Soft bristles: a Stribeck speed alone reduces the error by 1 %, less than the requirement for a law.
    few = (LAWS["stribeck"], LAWS["presliding"])
    monkeypatch.setattr(description, "laws_to_calibrate", lambda _: few)
    bristles = with_lumped_parameters(
        LAWS["presliding"].added_to(THESIS, 60.0),
        {"stribeck_speed": 2.0, "presliding_stiffness": 0.84, "presliding_damping": 2e-3},
    )
    calibration = calibrated(bristles, "auto")
    assert calibration.laws == ("stribeck", "presliding")
    assert calibration.parameters["presliding_stiffness"].value == pytest.approx(0.84, rel=0.05)


def laws_chosen_by(
    errors: Mapping[tuple[str, ...], float], candidates: Sequence[str], monkeypatch: pytest.MonkeyPatch
) -> list[str]:
    """Return the chosen laws for given errors by laws; a third law does not change the error."""

    class Table(law_selection._Trials):
        """Fits with given errors, nearly equal in four recordings; a third law does not change the error."""

        def fit(self, names: tuple[str, ...]) -> Any:
            logs = np.log(errors.get(names, errors[names[:2]])) + 1e-3 * np.arange(4) * len(names)
            return law_selection._Fit(THESIS, names, self.base.joint, np.zeros(len(names)), logs, logs)

        def described(self, *_: object) -> Any:
            return self.fit(())

        def cross_validated(self, fitted: Any) -> Any:
            return fitted

        def with_law(self, current: Any, law: Law, _: float) -> Any:
            return self.fit((*current.free, law.name))

    monkeypatch.setattr(law_selection, "_Trials", Table)
    monkeypatch.setattr(law_selection, "typical_motor_speed", lambda _: 60.0)
    laws = [LAWS[name] for name in candidates]
    base: Any = SimpleNamespace(joint=None)
    rows: Any = range(4)
    choice = law_selection.select_laws(rows, base, THESIS, (), laws, FitSettings((), 0, 0, 1))
    return [law.name for law in choice.laws]


@pytest.mark.parametrize(
    ("with_compliance", "with_cogging", "expected"),
    [
        (0.87, 0.87, ["presliding", "compliance"]),
        (0.89, 0.87, ["presliding"]),
        (0.87, 0.84, ["presliding", "cogging"]),
    ],
)
def test_a_law_that_was_sufficient_before_another_law_is_kept(
    monkeypatch: pytest.MonkeyPatch, with_compliance: float, with_cogging: float, expected: list[str]
) -> None:
    errors = {
        (): 1.0,
        ("presliding",): 0.88,
        ("compliance",): 0.92,
        ("cogging",): 0.995,
        ("presliding", "compliance"): with_compliance,
        ("presliding", "cogging"): with_cogging,
    }

    assert laws_chosen_by(errors, ("presliding", "compliance", "cogging"), monkeypatch) == expected


def test_a_law_that_reduces_the_error_only_without_another_law_is_not_kept(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # Without the true law, nearly every law reduces the error by a few percent.
    errors = {(): 1.0, ("stribeck",): 0.35, ("quadratic",): 0.96, ("stribeck", "quadratic"): 0.3485}
    assert laws_chosen_by(errors, ("stribeck", "quadratic"), monkeypatch) == ["stribeck"]


def test_named_laws_are_added_to_the_default_free_parameters() -> None:
    calibration = calibrated(STRIBECK, ["stribeck"], None, days=1)
    assert {*FREE, "stribeck_speed", "static"} <= set(calibration.parameters)
    assert calibration.parameters["stribeck_speed"].value == pytest.approx(20.0, rel=0.05)
    assert (calibration.laws, calibration.selection) == (("stribeck",), ())


def test_an_unidentifiable_law_is_named_with_the_required_manoeuvre() -> None:
    # With a constant load and at one temperature, heat has no identifiable effect.
    calibration = calibrated(THESIS, ["viscous-temperature"])
    assert calibration.unexcited == {"viscous-temperature": LAWS["viscous-temperature"].excited_by}
    assert not calibration.parameters["viscous_temperature"].identifiable
    assert "These recordings do not determine the law 'viscous-temperature'; recordings at" in str(
        calibration
    )


def test_impossible_choices_of_laws_are_refused() -> None:
    days = recordings_of(THESIS)
    with pytest.raises(MethodError, match="two recordings at least; add one of another manoeuvre, or name"):
        calibrate(days[0], THESIS, FREE, laws="auto")
    with pytest.raises(MethodError, match=r"unknown law 'stribek' \(did you mean 'stribeck'\?\)"):
        calibrate(days, THESIS, FREE, laws=["stribek"])
    with pytest.raises(MethodError, match=r"no parameter to calibrate; name some of .*, or laws to add"):
        calibrate(days, THESIS)
    with pytest.raises(MethodError, match=r"'hall_a' of law 'hall-angles' cannot be calibrated: phases that"):
        calibrate(days, THESIS, FREE, laws=["hall-angles"])
    assert LAWS["hall-angles"] not in laws_to_calibrate(THESIS)
    assert LAWS["cogging"] in laws_to_calibrate(THESIS)
