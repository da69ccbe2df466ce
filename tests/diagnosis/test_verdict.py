"""Verdicts from an estimate and its covariance: bounds, circle of the phase, limits of residuals."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cases import HEALTHY, THESIS
from emaphm.actuator import NAMES, Actuator, Faults
from emaphm.arrays import Array
from emaphm.diagnosis import Estimate
from emaphm.diagnosis.explanation.residuals import residual_within_limits
from emaphm.diagnosis.verdict import NOT_EXPLAINED, estimates, unexplained
from emaphm.diagnosis.wording import physical_text
from emaphm.estimation.space.parameter_space import PRIOR_DEVIATION, ParameterSpace
from emaphm.estimation.uncertainty.collinearity import CollinearSet
from emaphm.recording.noise import noise_level
from strategies import fault_vectors

SPACE = ParameterSpace.of(THESIS)


def estimates_of(errors: Any = 0.01, **faults: float) -> dict[str, Estimate]:
    """Return the estimates of `faults` whose coordinates have independent standard `errors`."""
    point = SPACE.points(Faults.from_mapping(faults).vector)
    return estimates(SPACE, point, np.diag(np.broadcast_to(errors, 8) ** 2.0))


def test_an_interval_is_196_standard_errors_either_way() -> None:
    friction = estimates_of(friction=0.5)["friction"]
    assert friction.value == 0.5
    assert friction.standard_error == pytest.approx(0.01)
    assert friction.interval95 == pytest.approx((0.4804, 0.5196), abs=1e-6)


@given(
    faults=fault_vectors(),
    error=st.floats(1e-4, 1.0),
    shrink=st.lists(st.floats(0, 1), min_size=8, max_size=8),
)
def test_values_and_intervals_are_within_their_limits(
    faults: Array, error: float, shrink: list[float]
) -> None:
    faults[5] *= 1 - 1e-12  # another test covers the circle itself
    result = estimates(SPACE, SPACE.points(faults), np.diag((error * (np.array(shrink) + 1e-3)) ** 2))
    assert tuple(result) == NAMES
    for name, estimate in result.items():
        low, high = estimate.interval95
        assert low <= estimate.value <= high
        assert high - low <= np.ptp(estimate.limits)
        assert bool(estimate.reason) == (not estimate.identifiable or estimate.verdict == "cannot tell")
        if name != "eccentricity_phase":
            assert estimate.limits == SPACE.limits(name)
            assert estimate.limits[0] <= low <= high <= 1


@given(faults=fault_vectors(), error=st.floats(1e-4, 1.0))
def test_a_verdict_is_consistent_with_its_interval(faults: Array, error: float) -> None:
    faults[5] *= 1 - 1e-12
    components = estimates(SPACE, SPACE.points(faults), np.eye(8) * error**2)
    for name in set(NAMES) - {"eccentricity_phase"}:
        (low, high), healthy = components[name].interval95, getattr(Faults(), name)
        if components[name].verdict == "degraded":
            assert max(low - healthy, healthy - high) > 0.02
        if components[name].verdict == "healthy":
            assert max(high - healthy, healthy - low) <= 0.1


@given(faults=fault_vectors(), error=st.floats(1e-4, 0.1))
def test_an_identifiable_component_is_undecided_only_by_its_interval(faults: Array, error: float) -> None:
    faults[2] = 0.0  # three equal shorts are undecided for another reason
    faults[5] *= 1 - 1e-12
    components = estimates(SPACE, SPACE.points(faults), np.eye(8) * error**2)
    for name in set(NAMES) - {"eccentricity_phase"}:
        (low, high), healthy = components[name].interval95, getattr(Faults(), name)
        near, far = max(low - healthy, healthy - high), max(high - healthy, healthy - low)
        assert (components[name].verdict == "cannot tell") == (near <= 0.02 and far > 0.1)


@pytest.mark.parametrize("name", ["friction", "backlash", "short_a", "short_b", "short_c", "eccentricity"])
@pytest.mark.parametrize(
    ("value", "verdict"),
    # Half an interval is 0.0196; the verdict is healthy if the interval reaches 0.02 or less.
    [(0.0, "healthy"), (0.03, "healthy"), (0.0395, "healthy"), (0.0397, "degraded"), (0.9, "degraded")],
)
def test_a_component_is_healthy_if_its_interval_nearly_reaches_the_healthy_value(
    name: str, value: float, verdict: str
) -> None:
    assert estimates_of(**{name: value})[name].verdict == verdict


@pytest.mark.parametrize(
    ("value", "verdict"),
    [(0.2, "degraded"), (0.4603, "degraded"), (0.4605, "healthy"), (0.5395, "healthy"), (0.5397, "degraded")],
)
def test_a_gain_may_be_degraded_either_way(value: float, verdict: str) -> None:
    assert estimates_of(gain=value)["gain"].verdict == verdict


def test_an_interval_of_half_the_range_is_not_identifiable_but_may_be_degraded() -> None:
    # The interval is 0.5 long at a standard error of 0.1276.
    assert estimates_of(0.127, friction=0.5)["friction"].identifiable
    open_ = estimates_of(0.128, friction=0.5)["friction"]
    assert (open_.verdict, open_.identifiable) == ("degraded", False)
    assert "anywhere in the interval" in open_.reason
    assert estimates_of(0.128, friction=0.1)["friction"].verdict == "cannot tell"
    assert "does not constrain" in estimates_of(0.15, friction=0.3)["friction"].reason


def test_an_interval_limited_only_by_the_bounds_is_not_degraded() -> None:
    # The interval of the gain is 0 to 0.35; without the bound at 0 it would be -0.24 to 0.35.
    gain = estimates_of(0.15, gain=0.056)["gain"]
    assert gain.interval95 == pytest.approx((0.0, 0.35), abs=1e-3)
    assert (gain.verdict, gain.identifiable) == ("cannot tell", False)
    assert "does not constrain" in gain.reason
    friction = estimates_of(0.15, friction=0.9)["friction"]
    assert (friction.verdict, friction.limits) == ("cannot tell", (-0.45, 1.0))


@given(faults=fault_vectors(), error=st.floats(1e-4, 1.0))
def test_a_degraded_component_is_never_called_unconstrained(faults: Array, error: float) -> None:
    faults[5] *= 1 - 1e-12
    components = estimates(SPACE, SPACE.points(faults), np.eye(8) * error**2)
    for name, estimate in components.items():
        if estimate.verdict != "cannot tell":
            assert "does not constrain" not in estimate.reason
            if name != "eccentricity_phase" and 3.92 * error > 0.5:
                # A wide interval with a verdict is not cut by the bounds of the range.
                assert np.ptp(estimate.interval95) >= 3.91 * error


def test_equal_shorts_in_all_windings_are_undecided() -> None:
    for shorts in ((0.2, 0.2, 0.2), (0.2, 0.5, 0.205)):
        components = estimates_of(short_a=shorts[0], short_b=shorts[1], short_c=shorts[2])
        for name in ("short_a", "short_b", "short_c"):
            assert components[name].verdict == "cannot tell"
            assert "weaker magnet" in components[name].reason
    different = estimates_of(short_a=0.2, short_b=0.3, short_c=0.5)
    assert {different[name].verdict for name in ("short_a", "short_b", "short_c")} == {"degraded"}
    assert estimates_of(short_b=0.2)["short_b"].verdict == "degraded"


@pytest.mark.parametrize("value", [0.0, 0.5, 1.0])
def test_an_error_close_to_the_prior_makes_a_component_unconstrained(value: float) -> None:
    # 0.7 of the standard deviation of the prior, 0.289.
    assert estimates_of(0.203, friction=value)["friction"].interval95 == (-0.45, 1.0)
    assert estimates_of(0.203, friction=value)["friction"].unconstrained
    assert estimates_of(0.203, friction=value)["friction"].verdict == "cannot tell"
    assert estimates_of(0.2, friction=1.0)["friction"].interval95 == pytest.approx((0.608, 1.0), abs=1e-3)


@pytest.mark.parametrize(
    ("value", "verdict"),
    # Half an interval is 0.0196, the same as above the healthy value.
    [(-0.0395, "healthy"), (-0.0397, "degraded"), (-0.45, "degraded")],
)
def test_friction_may_be_degraded_below_healthy(value: float, verdict: str) -> None:
    friction = estimates_of(0.01, friction=value)["friction"]
    assert friction.verdict == verdict
    assert friction.interval95[0] == pytest.approx(max(value - 0.0196, -0.45), abs=1e-6)
    words = physical_text(Faults(friction=value), THESIS)["friction"]
    assert words == f"dry friction × {1 + 2 * value:.3f}, below healthy"


@pytest.mark.parametrize(
    ("value", "verdict"),
    # Half an interval is 0.0588: from 0 to 0.0988 and 0.1008; lower ends of 0.0193 and 0.0212.
    [(0.04, "healthy"), (0.042, "cannot tell"), (0.078, "cannot tell"), (0.08, "degraded")],
)
def test_a_component_is_not_called_healthy_if_its_interval_has_relevant_faults(
    value: float, verdict: str
) -> None:
    friction = estimates_of(0.03, friction=value)["friction"]
    assert friction.verdict == verdict
    assert friction.identifiable
    assert ("relevant faults" in friction.reason) == (verdict == "cannot tell")


def test_the_reason_of_a_collinear_component_names_the_others() -> None:
    group = CollinearSet(("friction", "short_a", "load"), ("current_A",))
    point = SPACE.points(Faults(friction=0.1, short_a=0.5).vector)
    components = estimates(SPACE, point, np.eye(8) * 0.05**2, [group])
    # A component that is degraded in any case has no reason.
    assert components["short_a"].verdict == "degraded"
    assert components["short_a"].reason == ""
    assert components["friction"].verdict == "cannot tell"
    assert components["friction"].reason == "only its combined effect with short_a and load is identifiable"


def test_a_component_without_effect_has_a_reason() -> None:
    ideal = Actuator.from_dict(THESIS.model_dump() | {"electrical": None})
    space = ParameterSpace.of(ideal)
    components = estimates(space, space.points(HEALTHY), np.eye(space.dimensions) * 1e-6)
    assert tuple(components) == NAMES
    for name in NAMES[2:7]:
        assert components[name] == Estimate(
            getattr(Faults(), name),
            PRIOR_DEVIATION,
            (0.0, 1.0),
            identifiable=False,
            verdict="cannot tell",
            reason=space.fixed[name],
        )
    assert [components[name].verdict for name in ("friction", "backlash", "gain")] == ["healthy"] * 3


@pytest.mark.parametrize("errors", [(0.05, 0.05), (0.08, 0.01)])
def test_the_interval_of_eccentricity_has_its_coverage_for_a_centred_rotor(
    errors: tuple[float, float],
) -> None:
    draws, centred = 500, SPACE.points(HEALTHY)
    outside = 0
    for drawn in np.random.default_rng(3).normal(0.0, errors, (draws, 2)):
        point = centred.copy()
        point[5:7] = drawn
        covariance = np.diag(np.array([0.01] * 5 + [*errors, 0.01]) ** 2)
        outside += estimates(SPACE, point, covariance)["eccentricity"].interval95[0] > 0
    # Three standard deviations of a share of 5 %.
    assert outside / draws == pytest.approx(0.05, abs=3 * np.sqrt(0.05 * 0.95 / draws))


def test_without_eccentricity_the_phase_is_undefined() -> None:
    components = estimates_of(0.01, eccentricity=0.0)
    assert (components["eccentricity"].value, components["eccentricity"].verdict) == (0.0, "healthy")
    phase = components["eccentricity_phase"]
    assert not phase.identifiable
    assert (phase.verdict, phase.interval95) == ("cannot tell", (0.0, 1.0))
    assert phase.standard_error == pytest.approx(PRIOR_DEVIATION)
    assert "direction is undefined" in phase.reason


@pytest.mark.parametrize(("radius", "known"), [(0.0395, False), (0.0397, True), (0.5, True)])
def test_the_phase_is_identifiable_once_the_eccentricity_is_degraded(radius: float, known: bool) -> None:
    assert estimates_of(0.01, eccentricity=radius)["eccentricity_phase"].identifiable == known


@pytest.mark.parametrize("phase", [0.02, 0.3, 0.5, 0.77, 0.99])
def test_errors_of_radius_and_phase_agree_with_draws_from_the_covariance(phase: float) -> None:
    faults = Faults(eccentricity=0.4, eccentricity_phase=phase)
    point = SPACE.points(faults.vector)
    block = np.array([[4e-4, -1.5e-4], [-1.5e-4, 2e-4]])
    spread = np.eye(8) * 1e-6
    spread[5:7, 5:7] = block
    components = estimates(SPACE, point, spread)
    draws = np.random.default_rng(0).multivariate_normal(point[5:7], block, 20_000)
    turned = np.arctan2(draws[:, 1], draws[:, 0]) / (2 * np.pi) + 0.5 - phase
    # The deviation of 20,000 draws is accurate to 0.5 %; curvature adds (0.02 / 0.4)² = 0.25 %.
    assert components["eccentricity"].standard_error == pytest.approx(np.hypot(*draws.T).std(), rel=0.02)
    assert components["eccentricity_phase"].standard_error == pytest.approx(
        (turned - np.round(turned)).std(), rel=0.02
    )


@pytest.mark.parametrize(("along", "across"), [(0.001, 0.1), (0.02, 0.05), (0.05, 0.001), (0.03, 0.03)])
@pytest.mark.parametrize("radius", [0.01, 0.1, 0.4])
def test_the_interval_of_a_radius_covers_draws_of_any_direction(
    radius: float, along: float, across: float
) -> None:
    spread = np.eye(8) * 1e-6
    # Rotated by half a turn, like a phase of 0.
    spread[5:7, 5:7] = np.diag([along**2, across**2])
    point = SPACE.points(Faults(eccentricity=radius, eccentricity_phase=0.0).vector)
    draws = np.random.default_rng(1).multivariate_normal(point[5:7], spread[5:7, 5:7], 20_000)
    low, high = estimates(SPACE, point, spread)["eccentricity"].interval95
    size = np.hypot(*draws.T)
    # In the plane, 1.96 standard errors hold 85 % where the centre is at 0, and 95 % far from it.
    assert 0.85 < np.mean((size >= low) & (size <= high)) < 0.99


def test_the_interval_of_a_phase_may_pass_the_cut_of_its_circle() -> None:
    low, high = estimates_of(0.05, eccentricity=0.5, eccentricity_phase=0.99)["eccentricity_phase"].interval95
    # 1.96 × 0.05 / (2 pi 0.5) = 0.0312.
    assert (low, high) == pytest.approx((0.9588, 1.0212), abs=1e-3)


def test_the_phase_has_the_verdict_of_the_eccentricity() -> None:
    assert estimates_of(0.01, eccentricity=0.30)["eccentricity_phase"].verdict == "degraded"


def test_an_eccentricity_of_unknown_direction_may_be_degraded() -> None:
    point = SPACE.points(Faults(eccentricity=0.06).vector)
    errors = np.full(8, 0.001)
    errors[[i for i, name in enumerate(SPACE.coordinates) if name == "eccentricity_y"]] = 0.05
    components = estimates(SPACE, point, np.diag(errors**2))
    assert components["eccentricity"].verdict == "degraded"
    assert components["eccentricity_phase"].verdict == "cannot tell"
    assert "not its direction" in components["eccentricity_phase"].reason


def test_full_eccentricity_in_any_direction_is_a_fault_vector() -> None:
    angles = np.linspace(-np.pi, np.pi, 500)
    points = np.full((500, 8), 0.5)
    points[:, 5], points[:, 6] = 1.01 * np.cos(angles), 1.01 * np.sin(angles)
    for point in SPACE.project(points):
        values = [estimate.value for estimate in estimates(SPACE, point, np.eye(8) * 1e-6).values()]
        assert Faults(*values).eccentricity == pytest.approx(1.0)


def test_without_an_explanation_no_component_has_a_verdict() -> None:
    components = estimates_of([0.01] * 4 + [0.2] + [0.01] * 3, friction=0.5, short_c=0.5)
    assert {"healthy", "degraded", "cannot tell"} == {estimate.verdict for estimate in components.values()}
    undecided = unexplained(components, ("short_c",))
    assert tuple(undecided) == NAMES
    for name, estimate in undecided.items():
        # Values and intervals are unchanged; a component without effect keeps its reason.
        reason = components[name].reason if name == "short_c" else NOT_EXPLAINED
        assert estimate == replace(components[name], verdict="cannot tell", reason=reason)


TIME = np.arange(2500) / 5000
CURRENT = 3 * np.sin(2 * np.pi * 8 * TIME)
STRUCTURE = np.sqrt(2) * np.sin(2 * np.pi * 23 * TIME)
"""A misfit of 1 A rms."""


@pytest.mark.parametrize("noise", [0.0, 0.01, 0.1, 0.5, 2.0])
def test_noise_of_any_size_is_explained(noise: float) -> None:
    white = np.random.default_rng(0).normal(0, noise, CURRENT.size)
    assert residual_within_limits(CURRENT + white, white, noise_level(CURRENT + white), corrected=True)


@pytest.mark.parametrize("noise", [0.0, 0.01])
@pytest.mark.parametrize(("corrected", "limit"), [(False, 0.05), (True, 0.02)])
def test_the_limit_of_a_misfit_is_some_percent(noise: float, corrected: bool, limit: float) -> None:
    white = np.random.default_rng(0).normal(0, noise, CURRENT.size)
    rms = np.sqrt(np.mean(CURRENT**2))
    assert residual_within_limits(
        CURRENT + white,
        white + 0.9 * limit * rms * STRUCTURE,
        noise_level(CURRENT + white),
        corrected=corrected,
    )
    assert not residual_within_limits(
        CURRENT + white,
        white + 1.3 * limit * rms * STRUCTURE,
        noise_level(CURRENT + white),
        corrected=corrected,
    )


def test_structure_twice_as_large_as_the_noise_is_not_explained() -> None:
    white = np.random.default_rng(0).normal(0, 0.5, CURRENT.size)
    assert not residual_within_limits(
        CURRENT + white, white + 1.0 * STRUCTURE, noise_level(CURRENT + white), corrected=False
    )


@given(noise=st.floats(1e-3, 1.0), seed=st.integers(0, 50))
def test_the_noise_of_a_smooth_signal_is_measured(noise: float, seed: int) -> None:
    white = np.random.default_rng(seed).normal(0, noise, CURRENT.size)
    # From 2,500 rows with correlated second differences, it is accurate to some 2 %; the second
    # difference of the signal is 3 (2 pi 8 / 5000)² / sqrt(12) = 9e-5.
    assert noise_level(CURRENT + white) == pytest.approx(noise, rel=0.1, abs=1e-4)


def test_the_noise_level_of_a_parabola_is_that_of_its_curvature() -> None:
    assert noise_level(5 * TIME) == pytest.approx(0, abs=1e-12)
    assert noise_level(np.arange(100.0) ** 2) == pytest.approx(2 / np.sqrt(6))
