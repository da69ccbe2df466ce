"""Joint fits with faults: their normal equations, and the recordings that contradict the others."""

import numpy as np

from cases import THESIS
from emaphm.actuator import Chirp, Sine
from emaphm.actuator.unit.baseline import Baseline
from emaphm.estimation.finite_differences import one_sided_jacobians
from emaphm.estimation.joint.contradictions import dissenting
from emaphm.estimation.joint.correction import compared
from emaphm.estimation.joint.objective import JointObjective, RecordingTerm
from emaphm.estimation.joint.random_effects import random_effects
from emaphm.estimation.joint.uncertainty import AloneEstimates, joint_uncertainty
from emaphm.estimation.objective import faults_objective
from emaphm.estimation.posing import problem_of
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.uncertainty.local_covariance import jacobians_at, local_covariance, response_of
from emaphm.estimation.uncertainty.switching_scores import switching_errors, switching_scores
from emaphm.random_streams import stream
from emaphm.recording import Recording
from emaphm.simulated_recording import simulate

PRIORS = np.full(3, 0.3)


def test_faults_and_baseline_are_shared_and_each_recording_has_its_nuisances() -> None:
    known = THESIS.model_copy(update={"baseline": Baseline.of(("inertia",), np.array([[0.01]]), ("made",))})
    terms = []
    for names, duration in ((("load", "temperature"), 0.2), (("supply",), 0.1)):
        whole = simulate(THESIS, Chirp(duration=duration), duration=duration)
        recording = Recording({name: whole[name] for name in ("time_s", "command_rad", "current_A")})
        objective = faults_objective(problem_of(recording, known, channels=None), names)
        terms.append(RecordingTerm.of(objective, 9))
    unit = terms[0].objective.space.nuisances.unit
    joint = JointObjective(tuple(terms), unit, 2e-3, 1)
    assert (joint.faults, joint.shared, [term.own for term in terms]) == (8, 9, [2, 1])
    # The point is away from the bounds, and the eccentricity is inside its circle.
    point = np.array([0.3, 0.4, 0.3, 0.4, 0.3, 0.2, 0.3, 0.4, 0.1, 0.1, -0.1, 0.2])
    assert joint.box.lower.size == point.size
    for r, term in enumerate(terms):
        local = dict(zip(term.objective.space.coordinates, joint.local(r, point), strict=True))
        assert [local["friction"], local["gain"], local["baseline inertia"]] == [0.3, 0.4, 0.1]
        np.testing.assert_array_equal(joint.local(r, point)[term.shared_places], point[:9])
    assert [joint.local(0, point)[8], joint.local(0, point)[9], joint.local(1, point)[8]] == [0.1, -0.1, 0.2]

    (at,) = joint.evaluate(point[np.newaxis])
    ((normal, gradient),) = joint.normal_equations([at])

    def residual_rows(points: np.ndarray) -> np.ndarray:
        outcomes = joint.evaluate(points)
        priors = points[:, 8:9] * (20**0.5 / unit.priors)
        return np.hstack([-np.array([np.concatenate(outcome.residual) for outcome in outcomes]), priors])

    outputs = residual_rows(point[np.newaxis])
    (dense,) = one_sided_jacobians(residual_rows, point[np.newaxis], outputs, joint.box, joint.step)
    np.testing.assert_allclose(normal, dense @ dense.T, rtol=1e-9, atol=1e-9 * np.abs(normal).max())
    np.testing.assert_allclose(gradient, -dense @ outputs[0], rtol=1e-6, atol=1e-9 * np.abs(gradient).max())
    # Projection moves a point beyond the circle onto it.
    x = terms[0].objective.space.columns.index(5)
    point[x : x + 2] = 3.0, 4.0
    np.testing.assert_allclose(joint.box.project(point)[x : x + 2], [0.6, 0.8])


def test_a_slow_recording_has_the_covariance_of_a_single_fit() -> None:
    whole = simulate(THESIS, Sine(0.002, 2.0), duration=0.3, noise=0.05, sample_rate=2000.0)
    recording = Recording({name: whole[name] for name in ("time_s", "command_rad", "current_A")})
    objective = faults_objective(problem_of(recording, THESIS), ("load",))
    unit, shared = objective.space.nuisances.unit, len(objective.space.columns)
    joint = JointObjective((RecordingTerm.of(objective, shared),), unit, 2e-3, 1)
    (point,) = objective.space.points(np.array([[0.2, 0.3, 0.1, 0.1, 0.1, 0.3, 0.6, 0.45]]))
    (estimate,) = compared(joint, point[np.newaxis], 0, "start")
    together = joint_uncertainty(estimate, 0, slow_terms=True)

    result = SearchResult.at(objective, point, discrepancy=estimate.discrepancies[0])
    derivatives = jacobians_at(objective, point, stream(0, "Jacobians of the covariance", 0))
    response = response_of(result, stream(0, "Jacobians of the response", 0))
    errors = switching_errors(result, stream(0, "switching of the covariance", 0))
    assert response is not None
    scores = switching_scores(derivatives.mean(axis=0), errors)
    residual = estimate.corrected_residuals[0][: objective.channel_rows]
    single = local_covariance(objective, point, residual, derivatives, 0.0, scores, response)
    remaining = objective.space.project(point + single.step) - point
    expected = single.covariance + np.outer(remaining, remaining)
    np.testing.assert_allclose(together.covariance, expected, rtol=1e-6, atol=1e-6 * np.abs(expected).max())
    fast = joint_uncertainty(estimate, 0).covariance
    assert np.diag(expected)[-2] > 1.5 * np.diag(fast)[-2]  # the gain


def estimates(points: np.ndarray, deviation: float) -> AloneEstimates:
    covariances = np.tile(deviation**2 * np.eye(points.shape[1]), (len(points), 1, 1))
    return AloneEstimates(
        points, covariances, np.ones(len(points)), random_effects(points, covariances, PRIORS)
    )


def test_estimates_that_scatter_by_their_errors_do_not_contradict() -> None:
    rng = np.random.default_rng(1)
    any_dissenting = [
        dissenting(estimates(rng.normal(0.3, 0.05, (5, 3)), 0.05), PRIORS).any() for _ in range(100)
    ]
    # At a probability of 0.001 per set, two or more of 100 have a probability of 0.5 %.
    assert sum(any_dissenting) <= 1


def test_only_the_deviating_recordings_dissent() -> None:
    rng = np.random.default_rng(2)
    for _ in range(15):
        points = rng.normal(0.3, 0.02, (6, 3))
        points[1, 0] += 0.4
        assert dissenting(estimates(points, 0.02), PRIORS).tolist() == [False, True, *[False] * 4]
        points[4, 2] -= 0.3
        assert dissenting(estimates(points, 0.02), PRIORS).tolist() == [
            False,
            True,
            False,
            False,
            True,
            False,
        ]


def test_an_irrelevant_difference_is_no_contradiction() -> None:
    points = np.full((4, 3), 0.3)
    points[2] += 0.01
    assert not dissenting(estimates(points, 1e-4), PRIORS).any()


def test_estimates_along_one_curved_valley_do_not_contradict_each_other() -> None:
    offsets = np.array([-0.15, -0.05, 0.05, 0.15])
    points = np.stack([0.5 + offsets, 0.4 + 2 * offsets**2, np.full(4, 0.3)], axis=1)
    tangents = np.stack([np.ones(4), 4 * offsets, np.zeros(4)], axis=1)
    tangents /= np.linalg.norm(tangents, axis=1)[:, np.newaxis]
    covariances = 0.2**2 * np.einsum("ni,nj->nij", tangents, tangents) + 0.003**2 * np.eye(3)
    meta = random_effects(points, covariances, PRIORS)
    assert not dissenting(AloneEstimates(points, covariances, np.ones(4), meta), PRIORS).any()


def test_a_single_recording_does_not_dissent_and_of_two_both_do() -> None:
    points = np.array([[0.3, 0.3, 0.3], [0.3, 0.6, 0.3]])
    assert dissenting(estimates(points[:1], 0.01), PRIORS).tolist() == [False]
    assert dissenting(estimates(points, 0.01), PRIORS).tolist() == [True, True]
