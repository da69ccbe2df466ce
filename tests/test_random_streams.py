"""Streams of random numbers: equal for equal names, and without common numbers for different names."""

import ast
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import emaphm
from cases import THESIS, drawn, reference_recordings
from emaphm.errors import SignalError
from emaphm.estimation.bias_correction import correct_bias
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.posing import problem_of
from emaphm.estimation.space.parameter_space import ParameterSpace
from emaphm.random_streams import child_seed, stream

NAME = st.lists(st.one_of(st.text(max_size=8), st.integers(0, 2**40)), min_size=1, max_size=3).map(tuple)


@given(seed=st.integers(0, 2**64), name=NAME)
def test_the_same_name_gives_the_same_numbers(seed: int, name: tuple[str | int, ...]) -> None:
    np.testing.assert_array_equal(stream(seed, *name).random(5), stream(seed, *name).random(5))
    assert 0 <= child_seed(seed, *name) < 2**31


@given(seed=st.integers(0, 2**64), names=st.lists(NAME, min_size=2, max_size=4, unique=True))
def test_different_names_share_no_numbers(seed: int, names: list[tuple[str | int, ...]]) -> None:
    drawn_by = [set(stream(seed, *name).random(200)) for name in names]
    for first, second in combinations(drawn_by, 2):
        assert not first & second  # a common value among 2**53 cannot be chance


def test_similar_names_share_no_numbers() -> None:
    alike = [("a", "b"), ("ab",), ("a", 1), ("a1",), ("a", "1"), ("a", 1, 1), ("a", 11)]
    assert len({stream(0, *name).random() for name in alike}) == len(alike)
    assert stream(0, "a").random() != stream(1, "a").random()
    assert stream(0, "a").random() != np.random.default_rng(0).random()


def test_a_negative_seed_is_refused() -> None:
    with pytest.raises(SignalError, match="seed -3 is negative; give 0 or more"):
        stream(-3, "a")


def test_the_bias_correction_follows_its_seed() -> None:
    truth = drawn(1, seed=7)
    problem = problem_of(reference_recordings(truth, noise=0.05, duration=0.25)[0], THESIS)
    objective = MapObjective.of(problem, ParameterSpace.of(THESIS))
    start = objective.space.points(truth)
    ends = [correct_bias(objective, start, 1, seed).point for seed in (0, 0, 1)]
    np.testing.assert_array_equal(ends[0], ends[1])
    assert not np.array_equal(ends[0], ends[2])


def test_random_numbers_are_drawn_only_from_streams() -> None:
    # Cases of a study's plan are drawn from the plan's own seed, because they are published.
    exempt = {"random_streams.py", "study/cases.py", "study/record.py", "study/analysis/statistics.py"}
    root = Path(emaphm.__file__).parent
    names = ("default_rng", "SeedSequence")
    texts = {path: path.read_text(encoding="utf-8") for path in root.rglob("*.py")}
    files = {
        path.relative_to(root).as_posix()
        for path, text in texts.items()
        if any(name in text for name in names)  # few files do; other files need not be parsed
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Attribute) and node.attr in names
    }
    assert files <= exempt
