"""The speed budget of models, identification and start-up, on one core. Run by `make bench`."""

import os
import subprocess
import sys
from functools import reduce
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import emaphm as ema
from bench.conftest import Report
from emaphm.actuator.laws import law_named
from emaphm.estimation.bias_correction import MAX_CORRECTIONS
from emaphm.simulation import (
    AVERAGED,
    REFERENCE,
    Inputs,
    Model,
    Plant,
    monitor,
    observe_batch,
    run,
    simulate_batch,
)
from emaphm.study import cases
from emaphm.study.record import recorded
from emaphm.study.rig import Manoeuvre, Rig

CURRENT = ("current_A",)
VOLTAGE = (*CURRENT, "voltage_V")
EVERYTHING = (*VOLTAGE, "position_rad", "speed_rad_s")

RUNS = 64
"""Actuators in a batch: four groups of lanes."""

IDENTIFICATIONS = 16
"""Number of recordings, each diagnosed once, because times differ by up to a factor of three."""

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


OF_FRICTION = ("load-dependent", "stribeck", "stribeck-load", "directional", "quadratic", "transition")
RIGID = (
    *OF_FRICTION,
    *("viscous-temperature", "gravity", "cogging", "saturation", "sensor-lag", "source-resistance"),
)


@pytest.mark.parametrize(
    ("laws", "budget_ns"),
    [
        ((), 4.7),
        (OF_FRICTION, 9.0),
        (("stribeck", "presliding"), 9.0),
        (("emf-flats", "emf-sine"), 9.0),
        (RIGID, 9.0),
        ((*RIGID, "compliance"), 9.0),
    ],
    ids=["without", "friction", "bristle friction", "back-EMF", "all on a rigid shaft", "all"],
)
def test_laws(
    benchmark: Any, report: Report, request: pytest.FixtureRequest, laws: tuple[str, ...], budget_ns: float
) -> None:
    actuator = reduce(lambda partial, name: law_named(name).added_to(partial), laws, ema.Actuator.thesis())
    plant, driven = Plant.of(actuator, random_faults(RUNS)), inputs(AVERAGED)
    observe_batch(AVERAGED, plant, driven, channels=CURRENT, workers=1)
    benchmark(observe_batch, AVERAGED, plant, driven, channels=CURRENT, workers=1)
    steps = driven.samples * driven.substeps
    report(
        f"averaged model, {request.node.callspec.id} laws, {steps:,} steps",
        budget="≥ 1 ×",
        runs=RUNS,
        reference=budget_ns * 1e-9 * steps,
        against=f"{budget_ns:g} ns a step",
    )


@pytest.mark.parametrize("drive", ["foc", "six-step"])
@pytest.mark.parametrize("model", [REFERENCE, AVERAGED], ids=["reference", "averaged"])
def test_batch_of_drives(benchmark: Any, report: Report, model: Model, drive: str) -> None:
    actuator = ema.Actuator.pmsm()
    if drive != "foc":
        assert actuator.drive is not None
        actuator = actuator.model_copy(update={"drive": actuator.drive.model_copy(update={"kind": drive})})
    faults, driven = random_faults(RUNS), inputs(model)
    simulate_batch(model, actuator, faults[:1], driven)
    benchmark(simulate_batch, model, actuator, faults, driven, workers=1)
    budget = {"reference": "≥ 80 ×", "averaged": "≥ 4,000 ×"}[model.name]
    report(f"{model.name} model, drive {drive}, in a batch, per run", budget=budget, runs=RUNS)


@pytest.mark.parametrize(
    "channels", [CURRENT, VOLTAGE, EVERYTHING], ids=["current", "and-voltage", "four-channels"]
)
@pytest.mark.parametrize(
    ("most", "budget"), [(0, "≥ 5 ×"), (MAX_CORRECTIONS, "≥ 2 ×")], ids=["uncorrected", "corrected"]
)
def test_diagnosis(benchmark: Any, report: Report, channels: tuple[str, ...], most: int, budget: str) -> None:
    actuator, rig = ema.Actuator.thesis(), Rig(label="base setting", channels=channels)
    recordings = cycle(
        [
            recorded(rig, actuator, Manoeuvre(), cases.random_faults(seed), seed)
            for seed in range(IDENTIFICATIONS)
        ]
    )
    ema.diagnose(next(recordings), actuator)

    def another() -> tuple[tuple[ema.Recording, ema.Actuator], dict[str, Any]]:
        return (next(recordings), actuator), {"max_corrections": most, "workers": 1}

    benchmark.pedantic(ema.diagnose, setup=another, rounds=IDENTIFICATIONS)
    kind = "corrected" if most else "no correction"
    report(f"diagnosis, {len(channels)} channels, {kind}", budget=budget)


@pytest.mark.parametrize("workers", [1, None], ids=["one core", "all cores"])
@pytest.mark.parametrize("law", ["stribeck", "compliance"])
def test_diagnosis_without_a_law(
    benchmark: Any, report: Report, request: pytest.FixtureRequest, law: str, workers: int | None
) -> None:
    plant = law_named(law).added_to(ema.Actuator.thesis())
    actuator, rig = ema.Actuator.thesis(), Rig(label="base setting", channels=VOLTAGE)
    recording = recorded(rig, plant, Manoeuvre(), cases.random_faults(0), 0)
    benchmark.pedantic(ema.diagnose, (recording, actuator), {"workers": workers}, rounds=2, warmup_rounds=1)
    report(f"diagnosis, law '{law}' not described, {request.node.callspec.id}", budget="-")


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
    report("emaphm --help, whole process", budget="≤ 0.25 s", reference=0.25, against="its budget")


def test_diagnose_process(benchmark: Any, report: Report, recording: ema.Recording, tmp_path: Path) -> None:
    path = tmp_path / "recording.csv"
    names = ("time_s", "command_rad", "current_A", "voltage_V")
    ema.write_recording(ema.Recording({name: recording[name] for name in names}), path)
    command = [str(Path(sys.executable).with_name("emaphm")), "diagnose", str(path), "--json"]
    benchmark.pedantic(
        subprocess.run, (command,), {"check": True, "capture_output": True}, rounds=7, warmup_rounds=1
    )
    report("emaphm diagnose, whole process", budget="≤ 1.2 s", reference=1.2, against="its budget")


def test_first_compilation(benchmark: Any, report: Report, tmp_path_factory: pytest.TempPathFactory) -> None:
    script = (
        "import emaphm as ema; a = ema.Actuator.thesis(); "
        "ema.diagnose(ema.simulate(a, ema.Chirp()), a, seed=0)"
    )

    def first_run() -> None:
        cache = {**os.environ, "EMAPHM_CACHE_DIR": str(tmp_path_factory.mktemp("cache"))}
        subprocess.run([sys.executable, "-c", script], check=True, env=cache)  # noqa: S603 - our own script

    benchmark.pedantic(first_run, rounds=3)
    report("first diagnosis ever, compilation included, whole process", budget="-")
