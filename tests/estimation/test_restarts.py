"""Restarts of searches that do not explain a recording: their termination, and the result that is kept."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cases import HEALTHY, THESIS, drawn, reference_recordings
from emaphm.estimation.bias_correction import MAX_CORRECTIONS, with_discrepancy
from emaphm.estimation.global_search import restarts
from emaphm.estimation.methods import method_named
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.posing import problem_of
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.search_settings import SearchSettings
from emaphm.estimation.space.parameter_space import ParameterSpace

TRUTH = drawn(1, seed=7)[0]
SETTINGS = SearchSettings(method_named("hybrid"), MAX_CORRECTIONS, 5)


@pytest.fixture(scope="module")
def ends() -> dict[str, SearchResult]:
    """Return possible ends of a search: at the truth, somewhat away from it, and in a false minimum."""
    (recording,) = reference_recordings([TRUTH], noise=0.05)
    objective = MapObjective.of(problem_of(recording, THESIS), ParameterSpace.of(THESIS))
    vectors = {"truth": TRUTH, "off": np.clip(TRUTH + 0.1, 0, 1), "false": HEALTHY}
    points = {name: objective.space.points(vector) for name, vector in vectors.items()}
    results = {name: SearchResult.at(objective, point) for name, point in points.items()}
    return {name: with_discrepancy(result, seed=0) for name, result in results.items()}


@pytest.mark.parametrize(
    ("made", "searches", "kept"),
    [
        ("truth off off off", 1, "truth"),
        ("false off truth off", 3, "truth"),
        ("false off off truth", 3, "off"),  # two agree
        ("false off false false", 4, "off"),  # three more at most
    ],
)
def test_searches_stop_at_an_explanation_or_when_two_agree(
    made: str, searches: int, kept: str, ends: dict[str, SearchResult], monkeypatch: pytest.MonkeyPatch
) -> None:
    expected, seeds = [ends[name] for name in made.split()], list[int]()

    def search(_: MapObjective, settings: SearchSettings, *__: Any) -> SearchResult:
        seeds.append(settings.seed)
        return replace(expected[len(seeds) - 1])

    monkeypatch.setattr(restarts, "_search", search)
    monkeypatch.setattr(restarts, "refine_by_reference", lambda best, _: best)
    objective = ends["truth"].objective
    result = restarts.search_with_restarts(objective, SETTINGS, None)
    assert (len(seeds), seeds[0]) == (searches, 5)
    assert len(set(seeds)) == searches
    np.testing.assert_array_equal(result.point, ends[kept].point)
    assert len(result.alternatives) == searches - 1


@pytest.mark.parametrize(("hopeless", "searches"), [(False, 3), (True, 1)])
def test_no_search_follows_a_hopeless_search(
    hopeless: bool, searches: int, ends: dict[str, SearchResult], monkeypatch: pytest.MonkeyPatch
) -> None:
    made = [ends["off"], ends["false"], ends["off"]]
    monkeypatch.setattr(restarts, "_search", lambda *_: made.pop(0))
    monkeypatch.setattr(restarts, "refine_by_reference", lambda best, _: best)
    result = restarts.search_with_restarts(
        ends["off"].objective,
        SETTINGS,
        None,
        is_hopeless=lambda _: hopeless,
    )
    assert len(made) == 3 - searches
    np.testing.assert_array_equal(result.point, ends["off"].point)


@pytest.mark.parametrize(("heavy", "ended"), [(False, "off"), (True, "truth")])
def test_an_ensemble_refines_results_with_heavy_currents(
    heavy: bool, ended: str, ends: dict[str, SearchResult], monkeypatch: pytest.MonkeyPatch
) -> None:
    objective = ends["off"].objective
    monkeypatch.setattr(restarts, "is_heavy", lambda _: heavy)
    monkeypatch.setattr(
        restarts, "multistart", lambda *_: SimpleNamespace(points=ends["off"].point[np.newaxis])
    )
    monkeypatch.setattr(restarts, "correct_bias", lambda *_: ends["off"])
    monkeypatch.setattr(restarts, "refine_by_ensemble", lambda *_: ends["truth"])
    monkeypatch.setattr(restarts, "leaves_switching_alone", lambda _: True)
    monkeypatch.setattr(restarts, "MAX_RESTARTS", 0)
    monkeypatch.setattr(restarts, "refine_by_reference", lambda best, _: best)
    result = restarts.search_with_restarts(objective, SETTINGS, None)
    np.testing.assert_array_equal(result.point, ends[ended].point)


@pytest.mark.parametrize("converged", [True, False])
def test_iterations_follow_steps_that_have_not_converged(
    converged: bool, ends: dict[str, SearchResult], monkeypatch: pytest.MonkeyPatch
) -> None:
    objective = ends["truth"].objective
    steps = replace(ends["off"] if not converged else ends["truth"], converged=converged)
    monkeypatch.setattr(restarts, "correct_by_steps", lambda *_: steps)
    monkeypatch.setattr(restarts, "correct_bias", lambda *_, **__: replace(ends["truth"], converged=True))
    result = restarts.search_with_restarts(objective, SETTINGS, None, starts=ends["off"].point[np.newaxis])
    np.testing.assert_array_equal(result.point, ends["truth"].point)
    assert result.started
