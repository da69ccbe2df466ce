"""Kernels on disk: compiled once, and compiled again if they are damaged or out of date."""

import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from emaphm.actuator import Faults, Sine
from emaphm.arrays import Array
from emaphm.simulation import AVERAGED, Inputs, Model, Plant, run
from emaphm.simulation.engine import compilation, kernel_cache
from emaphm.simulation.engine.model import Layout
from emaphm.simulation.engine.structure import Structure
from simulation.rig import INTERVAL, THESIS

CHANNELS = len(AVERAGED.form(Structure()).channels)
INPUTS = Inputs.of(Sine(8e-3, 15.0), 0.02, samples=100, interval=INTERVAL, step=AVERAGED.step)
CODE: list[bytes] = []


def simulated(model: Model = AVERAGED) -> Array:
    """Return the current of a run with its kernel read from disk."""
    kernel_cache.kernel.cache_clear()
    return run(model, Plant.of(THESIS, Faults().vector), INPUTS)["current_A"]


@pytest.fixture(name="compilations")
def _compilations(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Store kernels in an empty folder, and return the names of the models that are compiled for it."""
    if not CODE:
        # The kernel is loaded from the folder of the other tests, or compiled for them.
        loaded = kernel_cache._loaded

        def recorded(code: bytes) -> kernel_cache.Kernel:
            CODE.append(code)
            return loaded(code)

        with monkeypatch.context() as patched:
            patched.setattr(kernel_cache, "_loaded", recorded)
            kernel_cache.kernel.cache_clear()
            simulated()
    names: list[str] = []

    def compiled(model: Model, layout: Layout) -> bytes:
        assert (layout.lanes, layout.channels) == (1, CHANNELS)
        names.append(model.name)
        return CODE[0]

    monkeypatch.setattr(compilation, "compiled", compiled)
    monkeypatch.setattr(kernel_cache, "kernel_folder", lambda: tmp_path)
    return names


def only_file(folder: Path) -> Path:
    (file,) = folder.iterdir()
    return file


def test_a_kernel_is_compiled_once(compilations: list[str], tmp_path: Path) -> None:
    first, second = simulated(), simulated()
    assert compilations == ["averaged"]
    np.testing.assert_array_equal(first, second)
    assert np.ptp(first) > 1.0  # a constant would agree too
    only_file(tmp_path)


@pytest.mark.parametrize(
    "damage",
    [
        lambda content: content[:0],
        lambda content: content[:-1],
        lambda content: content[:100] + bytes([content[100] ^ 1]) + content[101:],
        lambda content: bytes([content[0] ^ 1]) + content[1:],
    ],
    ids=["empty", "cut", "flipped bit", "other revision"],
)
def test_a_damaged_kernel_is_compiled_again(
    damage: Callable[[bytes], bytes], compilations: list[str], tmp_path: Path
) -> None:
    current = simulated()
    kept = only_file(tmp_path).read_bytes()
    only_file(tmp_path).write_bytes(damage(kept))
    np.testing.assert_array_equal(simulated(), current)
    assert compilations == ["averaged"] * 2
    assert only_file(tmp_path).read_bytes() == kept


def test_a_kernel_of_changed_source_is_compiled_again(
    compilations: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    simulated()
    monkeypatch.setattr(kernel_cache, "SOURCES", b"edited")
    simulated()
    assert compilations == ["averaged"] * 2


def test_models_do_not_share_a_kernel(compilations: list[str], tmp_path: Path) -> None:
    simulated()
    simulated(replace(AVERAGED, name="averaged: mine/2"))
    assert compilations == ["averaged", "averaged: mine/2"]
    assert len(list(tmp_path.iterdir())) == 2


def test_with_a_folder_that_cannot_be_written_the_kernel_is_compiled_again(
    compilations: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    taken = tmp_path / "file"
    taken.touch()
    monkeypatch.setattr(kernel_cache, "kernel_folder", lambda: taken / "below")
    np.testing.assert_array_equal(simulated(), simulated())
    assert compilations == ["averaged"] * 2


def test_a_cached_kernel_runs_without_the_compiler() -> None:
    program = (
        "import sys, emaphm as ema\n"
        "from emaphm.simulation import AVERAGED, Inputs, simulate_batch\n"
        "inputs = Inputs.of(ema.Chirp(), samples=10, interval=2e-4, step=AVERAGED.step)\n"
        "currents = simulate_batch(AVERAGED, ema.Actuator.thesis(), [[0.0] * 7 + [0.5]], inputs)\n"
        "print(currents.shape, 'emaphm.simulation.engine.compilation' in sys.modules)\n"
    )
    for _ in range(2):  # the first run may have to compile
        result = subprocess.run(  # noqa: S603 - this interpreter
            [sys.executable, "-c", program], capture_output=True, text=True, check=True
        )
    assert result.stdout == "(1, 10) False\n"
    assert not result.stderr
