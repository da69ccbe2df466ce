"""Compiled kernels: vector instructions for several lanes, without calls of other functions."""

import re
from typing import Any

import pytest

from emaphm.actuator import Actuator
from emaphm.simulation import MODELS, OBSERVABLE, Model
from emaphm.simulation.engine import compilation
from emaphm.simulation.engine.model import Layout
from emaphm.simulation.engine.plant import structure_of

STRUCTURE = structure_of(Actuator.thesis())


@pytest.mark.parametrize("channels", [1, len(OBSERVABLE)])
@pytest.mark.parametrize("model", MODELS.values(), ids=list(MODELS))
def test_kernels_are_compiled_to_vector_instructions(
    model: Model, channels: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    modules: list[str] = []
    optimized = compilation._optimized

    def recorded(*arguments: Any) -> Any:
        module = optimized(*arguments)
        modules.append(str(module))
        return module

    monkeypatch.setattr(compilation, "_optimized", recorded)
    compilation.compiled(model, Layout(16, channels, STRUCTURE, (("carried", 1.0),)))
    (text,) = modules
    # Only the time of a step, which is the same for all lanes, is computed as a scalar.
    assert len(re.findall(r"f(?:add|sub|mul|div) fast <\d+ x double>", text)) > 50
    assert len(re.findall(r"f(?:add|sub|mul|div) fast double", text)) < 10
    assert not re.search(r"call [^@\n]*@(?!llvm\.)", text)
