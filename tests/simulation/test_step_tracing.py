"""Tracing of a step: operations agree with NumPy, and operations without a kernel are refused."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from emaphm.simulation import AVERAGED, Inputs, Model, Plant, run
from emaphm.simulation.engine import kernel_cache
from emaphm.simulation.engine.structure import Structure
from emaphm.simulation.laws.select import clip, select
from simulation.rig import THESIS

FORM = AVERAGED.form(Structure())
PLANT = Plant.of(THESIS, np.zeros(8))

STEP = 5e-5
ROWS = 64
X, Y = 3.0 * np.random.default_rng(5).normal(size=(2, ROWS))
X[:3] = Y[:3]  # equal values
Y[3:6] = 0.0

Law = Callable[[Any, Any], Any]

LAWS: dict[str, list[Law]] = {
    "arithmetic": [
        lambda x, y: x + y,
        lambda x, y: 2.0 - x * y,
        lambda x, y: np.float64(3.0) * x / (1.0 + y * y),
        lambda x, _: -x + 1,
    ],
    "functions": [
        lambda x, _: np.abs(x),
        lambda x, y: np.copysign(x, np.minimum(y, -1.0)),
        lambda x, y: np.sqrt(x * x + y * y),
        lambda x, y: np.cos(x) + 2.0 * np.sin(y),
    ],
    "choices": [
        lambda x, y: np.minimum(x, y) + 2.0 * np.maximum(y, 0.5),
        lambda x, y: select((x < y) & (y >= 0.0), x, select(x == y, 7.0, y)),
        lambda x, y: select(x > y, 1.0, 0.0) + select(x <= 0.0, 2.0, 0.0),
        lambda x, y: clip(x, -1.0, 1.0) + 0.0 * y,
    ],
}


def showing(laws: list[Law]) -> Model:
    """Return the averaged model with `laws` of command and load as its first channels."""

    def advance(structure: Structure) -> Callable[..., Any]:
        step = FORM.advance(structure)

        def shown(s: Any, p: Any, u: Any) -> Any:
            following, outputs = step(s, p, u)
            first = tuple(law(u.command, u.load) for law in laws)
            return following, first + outputs[len(first) :]

        return shown

    return replace(AVERAGED, forms={"hysteresis": replace(FORM, advance=advance)})


def shown_by(laws: list[Law], monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Return the channels (ROWS,) of `laws` of X and Y, recorded by a kernel."""
    monkeypatch.setattr(kernel_cache, "_read", lambda *_: None)
    monkeypatch.setattr(kernel_cache, "_write", lambda *_: None)
    inputs = Inputs(X, Y, np.zeros(ROWS), ROWS, 1, STEP, np.ones(ROWS))
    return list(run(showing(laws), PLANT, inputs).values())[: len(laws)]


@pytest.mark.parametrize("laws", LAWS.values(), ids=list(LAWS))
def test_a_kernel_agrees_with_numpy(laws: list[Law], monkeypatch: pytest.MonkeyPatch) -> None:
    for law, shown in zip(laws, shown_by(laws, monkeypatch), strict=True):
        # Products and sums may be computed in another order, or fused.
        np.testing.assert_allclose(shown, law(X, Y), rtol=0, atol=1e-13)


@pytest.mark.parametrize(
    ("law", "reason"),
    [
        (lambda x, _: max(0.0, x), r"select\(condition, chosen, other\)"),
        (lambda x, _: np.arctan(x), "no arctan; it has absolute, add, .*where"),
        (lambda x, _: np.linalg.norm(x), "no .*; it has"),
        (lambda x, _: math.sqrt(x), "NumPy's functions, not math's"),
        (lambda x, _: np.clip(x, 0.0, 1.0), "no clip; it has"),
    ],
    ids=["branch", "function", "reduction", "math", "clip"],
)
def test_operations_that_a_kernel_lacks_are_refused(
    law: Law, reason: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(TypeError, match=reason):
        shown_by([law], monkeypatch)
