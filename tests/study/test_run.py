"""Results do not depend on workers, order or interruptions; a failed run does not affect other runs."""

import multiprocessing
import random
import shutil
import time
from collections.abc import Callable, Generator, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import polars as pl
import pytest

from amortized.toys import THESIS, constant_estimator
from emaphm.actuator import Chirp, Faults
from emaphm.amortized.recording_setup import RecordingSetup
from emaphm.arrays import Array
from emaphm.errors import StudyError
from emaphm.estimation.search import search
from emaphm.execution import Outcome, Task
from emaphm.execution import run as execution_module
from emaphm.optimizers import Dragonfly
from emaphm.optimizers.dragonfly import DragonflyState
from emaphm.recording import Recording
from emaphm.study import Plan, Store, run_study
from emaphm.study import task as task_module
from emaphm.study.revision import revision
from emaphm.study.task import perform
from emaphm.study.trials import Trial, trials_of

from . import small

PLAN = small.plan(top="noises_A = [0, 0.1]")
TOTAL = 24

WITH_HYBRID = small.plan(
    ("runs = 3", "runs = 1"), top="noises_A = [0, 0.1]", end='[[methods]]\nmethod = "hybrid"\nturns = 0\n'
)
"""The same plan with a method that takes ten times as long, for tests in which its results may differ."""


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> pl.DataFrame:
    """Return the results of one worker without interruption."""
    return small.table(run_study(PLAN, tmp_path_factory.mktemp("undisturbed") / "study", workers=1))


@pytest.fixture(scope="module")
def undisturbed_hybrid(tmp_path_factory: pytest.TempPathFactory) -> pl.DataFrame:
    """Return the same results for the plan with hybrid."""
    return small.table(run_study(WITH_HYBRID, tmp_path_factory.mktemp("undisturbed") / "study", workers=1))


def test_the_undisturbed_study_is_complete(
    undisturbed: pl.DataFrame, undisturbed_hybrid: pl.DataFrame
) -> None:
    for results, total in ((undisturbed, TOTAL), (undisturbed_hybrid, 12)):
        assert results["index"].to_list() == list(range(total))
        assert np.isfinite(results["error_percent"].to_numpy()).all()


# Times


def test_a_method_is_compiled_before_its_time_is_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    events: list[str] = []
    clock, move = time.perf_counter, Dragonfly._move

    def watched_clock() -> float:
        events.append("clock")
        return clock()

    def watched_move(self: Dragonfly, state: DragonflyState, fitness: Array) -> DragonflyState:
        events.append("move")
        return move(self, state, fitness)

    monkeypatch.setattr(task_module, "time", SimpleNamespace(perf_counter=watched_clock))
    monkeypatch.setattr(Dragonfly, "_move", watched_move)
    trial = trials_of(PLAN)[0]
    perform(PLAN.actuator, PLAN.manoeuvre, trial, revision())
    # One move for compilation, then three populations of the search between two readings of the clock.
    assert events == ["move", "clock", "move", "move", "move", "clock"]


# The same bits


@pytest.mark.usefixtures("warm_workers")
def test_workers_do_not_change_results(undisturbed_hybrid: pl.DataFrame, tmp_path: Path) -> None:
    store = run_study(WITH_HYBRID, tmp_path / "study", workers=2)
    assert small.table(store).equals(undisturbed_hybrid)
    assert not multiprocessing.active_children()


def test_order_does_not_change_results(
    undisturbed_hybrid: pl.DataFrame, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def shuffled(tasks: Sequence[Task], **options: Any) -> Generator[Outcome]:
        order = random.Random(5).sample(tasks, len(tasks))  # noqa: S311 - not for security
        assert order != list(tasks)
        yield from outcomes(order, **options)

    outcomes = execution_module.outcomes
    monkeypatch.setattr(execution_module, "outcomes", shuffled)
    store = run_study(WITH_HYBRID, tmp_path / "study", workers=1)
    assert small.table(store).equals(undisturbed_hybrid)


def test_an_interrupted_study_is_resumed_without_repeating_runs(
    undisturbed: pl.DataFrame, tmp_path: Path
) -> None:
    folder = tmp_path / "study"

    def interrupt(done: int, total: int) -> None:
        assert total == TOTAL
        if done == 14:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_study(PLAN, folder, workers=1, on_run=interrupt)
    interrupted = Store.open(folder)
    assert interrupted.results.height == 14
    progress_calls: list[tuple[int, int]] = []
    store = run_study(PLAN, folder, workers=1, on_run=lambda *progress: progress_calls.append(progress))
    assert progress_calls == [(done, TOTAL) for done in range(14, TOTAL + 1)]
    # Their times are those of the first session.
    assert store.results.head(14).equals(interrupted.results)
    assert small.table(store).equals(undisturbed)
    assert store.elapsed_seconds >= interrupted.elapsed_seconds + float(
        store.results["wall_seconds"][14:].to_numpy().sum()
    )


WITH_ESTIMATOR = """\
name = "estimator"
runs = 1

[manoeuvre]
duration = 0.1
sample_rate = 2000

[cases]
worn = {{ friction = 0.3 }}

[[methods]]
method = "hybrid"
estimator = "{file}"
fast = true

[[rigs]]
label = "bench"
load = [0, 0]
heat = [0, 0]

[[groups]]
label = "named"
cases = ["worn"]
runs = 2
"""


@pytest.mark.usefixtures("answers_taken")
def test_an_estimator_replaced_during_the_study_does_not_diagnose(tmp_path: Path) -> None:
    setup = RecordingSetup.of(THESIS, Chirp(duration=0.1), duration=0.1, sample_rate=2000.0)
    file, first, second = (tmp_path / f"{name}.estimator" for name in ("unit", "one", "other"))
    for path, friction in ((first, 0.3), (second, 0.31)):
        constant_estimator(setup, setup.space.points(Faults(friction=friction).vector), 0.02).save(path)
    shutil.copy(first, file)
    plan = Plan.from_toml_text(WITH_ESTIMATOR.format(file=file))

    def replace_it(done: int, total: int) -> None:
        assert total == 2
        if done == 1:
            shutil.copy(second, file)

    with pytest.raises(StudyError, match=r"1 of 2 runs failed.*unit\.estimator: has changed since the work"):
        run_study(plan, tmp_path / "study", workers=1, on_run=replace_it)
    shutil.copy(first, file)
    estimates = run_study(plan, tmp_path / "study", workers=1).results["found"].to_list()
    # The remaining difference is from the half precision of the weights.
    assert estimates[1][0] == pytest.approx(0.3, abs=1e-3)


def test_a_share_is_the_first_run_of_each_kind_and_the_rest_may_follow(
    undisturbed: pl.DataFrame, tmp_path: Path
) -> None:
    folder = tmp_path / "study"
    part = run_study(PLAN, folder, share=1 / 3, workers=1)
    # The first run of both cases, by two methods at two noise levels.
    assert small.table(part).equals(undisturbed.filter(pl.col("run") == 0))
    assert small.table(run_study(PLAN, folder, workers=1)).equals(undisturbed)
    assert run_study(PLAN, folder, share=1e-9, workers=1).results.height == TOTAL


@pytest.mark.parametrize("share", [0.0, -0.1, 1.01, float("nan")])
def test_an_impossible_share_is_refused(tmp_path: Path, share: float) -> None:
    with pytest.raises(StudyError, match="cannot be taken; give more than 0, up to 1"):
        run_study(PLAN, tmp_path / "study", share=share)
    assert not (tmp_path / "study").exists()


def do(trial: Trial) -> dict[str, Any]:
    return perform(PLAN.actuator, PLAN.manoeuvre, trial, revision())


def test_methods_share_their_recordings_including_noise(monkeypatch: pytest.MonkeyPatch) -> None:
    currents_by_run: dict[tuple[str, int, float], list[np.ndarray[Any, Any]]] = {}
    record = task_module._exact_recording

    def listen(actuator: Any, manoeuvre: Any, trial: Trial) -> Recording:
        recording = record(actuator, manoeuvre, trial)
        currents_by_run.setdefault((trial.case, trial.run, trial.noise_A), []).append(recording["current_A"])
        return recording

    monkeypatch.setattr(task_module, "_exact_recording", listen)
    for trial in trials_of(PLAN):
        do(trial)
    assert len(currents_by_run) == 2 * 3 * 2
    for currents in currents_by_run.values():
        assert len(currents) == 2
        assert all(np.array_equal(current, currents[0]) for current in currents)
    for case in ("worn", "loose"):
        exact = [currents_by_run[case, run, 0.0][0] for run in range(3)]
        noise = [currents_by_run[case, run, 0.1][0] - exact[run] for run in range(3)]
        assert np.array_equal(exact[0], exact[1])
        assert not np.array_equal(noise[0], noise[1])
        # 3 × 250 samples determine an rms to 1 / sqrt(1500) = 2.6 %; five of these deviations are 13 %.
        assert np.sqrt(np.mean(np.square(noise))) == pytest.approx(0.1, rel=0.13)


def test_a_worker_of_another_version_is_refused() -> None:
    with pytest.raises(StudyError, match=r"another version of emaphm \(.*; the study's is 0123\); install"):
        perform(PLAN.actuator, PLAN.manoeuvre, trials_of(PLAN)[0], "0123")


# Runs that fail


@pytest.fixture
def broken(monkeypatch: pytest.MonkeyPatch) -> Callable[[Callable[[Trial], bool]], None]:
    """Return a function that makes the search of selected runs raise."""

    def break_(selected: Callable[[Trial], bool]) -> None:
        chosen = {trial.seed for trial in trials_of(PLAN) if selected(trial)}
        searched = search

        def search_or_fail(*arguments: Any, **options: Any) -> Any:
            if arguments[1].seed in chosen:
                raise ZeroDivisionError("the swarm\nhas gone")
            return searched(*arguments, **options)

        monkeypatch.setattr(task_module, "search", search_or_fail)

    return break_


def test_a_failed_run_is_named_and_does_not_affect_others(
    undisturbed: pl.DataFrame,
    tmp_path: Path,
    broken: Callable[[Callable[[Trial], bool]], None],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    folder = tmp_path / "study"
    broken(lambda trial: (trial.case, trial.run) == ("loose", 1))
    progress_calls: list[tuple[int, int]] = []
    with pytest.raises(StudyError) as refusal:
        run_study(PLAN, folder, workers=1, on_run=lambda *progress: progress_calls.append(progress))
    message = str(refusal.value)
    assert len(message.splitlines()) == 1
    assert message.startswith(f"4 of {TOTAL} runs failed, the first: loose, few, run 1: ZeroDivisionError")
    assert f"stored in {folder}" in message
    # Two methods at two noise levels have failed; the other runs are present and were counted.
    assert progress_calls == [(done, TOTAL) for done in range(TOTAL - 4 + 1)]
    assert Store.open(folder).results.height == TOTAL - 4
    monkeypatch.undo()
    progress_calls.clear()
    store = run_study(PLAN, folder, workers=1, on_run=lambda *progress: progress_calls.append(progress))
    assert progress_calls[0] == (TOTAL - 4, TOTAL)
    assert small.table(store).equals(undisturbed)


def test_all_runs_may_fail(tmp_path: Path, broken: Callable[[Callable[[Trial], bool]], None]) -> None:
    broken(lambda _: True)
    with pytest.raises(StudyError, match=rf"^{TOTAL} of {TOTAL} runs failed, the first: worn, few, run 0"):
        run_study(PLAN, tmp_path / "study", workers=1)
    assert Store.open(tmp_path / "study").results.is_empty()


def test_a_case_that_cannot_be_recorded_is_a_failed_run(tmp_path: Path) -> None:
    still = small.plan(("[manoeuvre]", "[manoeuvre]\namplitude = 0"))
    with pytest.raises(StudyError, match=r"12 of 12 runs failed, the first: worn, few, run 0: .*commanded"):
        run_study(still, tmp_path / "study", workers=1)
