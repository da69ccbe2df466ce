"""The speed budget: models, identification, start-up. Run by `make bench`, one core each."""

import os
import subprocess
import sys
from dataclasses import replace
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import emaphm as ema
from bench import cases
from bench.conftest import Report
from bench.rig import BASE, CURRENT, EVERYTHING, VOLTAGE, recorded
from emaphm.estimation.bias_correction import MAX_CORRECTIONS
from emaphm.simulation import AVERAGED, REFERENCE, Inputs, Model, Plant, monitor, run, simulate_batch

RUNS = 64
"""Actuators in a batch: four groups of lanes."""

IDENTIFICATIONS = 16
"""Recordings that are each diagnosed once: one takes up to three times another's time."""

THESIS_RUN_S = 1000.0
"""One optimisation of 50 agents × 100 iterations in the thesis (6.5), seconds."""


def inputs(model: Model) -> Inputs:
    return Inputs.of(ema.Chirp(), samples=2500, interval=2e-4, step=model.step)


def random_faults(n: int) -> Any:
    faults = np.random.default_rng(0).random((n, 8))
    faults[:, 2:5] *= 0.7
    return faults


@pytest.fixture(scope="module")
def recording() -> ema.Recording:
    faults = ema.Faults(friction=0.3, backlash=0.4, short_b=0.25, eccentricity=0.35, gain=0.4)
    return ema.simulate(ema.Actuator.thesis(), ema.Chirp(), faults=faults, noise=0.05)


def test_reference_model_single(benchmark: Any, report: Report) -> None:
    plant, driven = Plant.of(ema.Actuator.thesis(), random_faults(1)), inputs(REFERENCE)
    benchmark(run, REFERENCE, plant, driven)
    report("reference model, one run with every signal", budget="≥ 12 ×")


@pytest.mark.parametrize(
    ("model", "budget"),
    [(REFERENCE, "≥ 60 ×"), (AVERAGED, "≥ 6,000 ×"), (monitor(), "-")],
    ids=["reference", "averaged", "monitor"],
)
def test_batch(benchmark: Any, report: Report, model: Model, budget: str) -> None:
    faults, driven = random_faults(RUNS), inputs(model)
    simulate_batch(model, ema.Actuator.thesis(), faults[:1], driven)
    benchmark(simulate_batch, model, ema.Actuator.thesis(), faults, driven, workers=1)
    report(f"{model.name} model, in a batch, per run", budget=budget, runs=RUNS)


@pytest.mark.parametrize(
    "channels", [CURRENT, VOLTAGE, EVERYTHING], ids=["current", "and-voltage", "four-channels"]
)
@pytest.mark.parametrize("turns", [0, MAX_CORRECTIONS], ids=["uncorrected", "corrected"])
def test_identification(benchmark: Any, report: Report, channels: tuple[str, ...], turns: int) -> None:
    actuator, rig = ema.Actuator.thesis(), replace(BASE, channels=channels)
    recordings = cycle([recorded(rig, cases.random_faults(seed), seed) for seed in range(IDENTIFICATIONS)])
    ema.diagnose(next(recordings), actuator)

    def another() -> tuple[tuple[ema.Recording, ema.Actuator], dict[str, Any]]:
        return (next(recordings), actuator), {"turns": turns, "workers": 1}

    benchmark.pedantic(ema.diagnose, setup=another, rounds=IDENTIFICATIONS)
    kind = "corrected" if turns else "no correction"
    report(f"eight-fault identification, {len(channels)} channels, {kind}", budget="> 1 ×")


def test_thesis_run(benchmark: Any, report: Report, recording: ema.Recording) -> None:
    actuator = ema.Actuator.thesis()
    benchmark.pedantic(
        ema.diagnose,
        (recording, actuator),
        {"method": "dragonfly-thesis", "model": "monitor", "fitness": "thesis", "workers": 1},
        rounds=3,
        warmup_rounds=1,
    )
    report(
        "the thesis's run: dragonfly 50 × 100, monitor model",
        budget="≤ 3 s",
        reference=THESIS_RUN_S,
        against="the thesis",
    )


def test_help(benchmark: Any, report: Report) -> None:
    command = [str(Path(sys.executable).with_name("emaphm")), "--help"]
    benchmark(subprocess.run, command, check=True, capture_output=True)
    report("emaphm --help, whole process", budget="≤ 0.5 s", reference=0.5, against="its budget")


def test_first_compilation(benchmark: Any, report: Report, tmp_path_factory: pytest.TempPathFactory) -> None:
    script = (
        "import emaphm as ema; a = ema.Actuator.thesis(); "
        "ema.diagnose(ema.simulate(a, ema.Chirp()), a, seed=0)"
    )

    def first_run() -> None:
        cache = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path_factory.mktemp("cache"))}
        subprocess.run([sys.executable, "-c", script], check=True, env=cache)  # noqa: S603 - our own script

    benchmark.pedantic(first_run, rounds=3)
    report("first diagnosis ever, compilation included, whole process", budget="-")
