"""Settings of all tests, and recordings that several test files diagnose, each simulated once."""

import gc
import importlib
import signal
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import settings

from cases import THESIS
from dask_processes import Forks, forking
from emaphm.actuator import Chirp, Faults
from emaphm.actuator.unit.model_error import NOT_LEARNED
from emaphm.amortized.applicability import delays
from emaphm.diagnosis.selection.laws import law_fit
from emaphm.estimation.global_search import restarts
from emaphm.recording import Recording
from emaphm.simulated_recording import simulate
from warm_processes import warm_processes

# Examples are the same in each run, like all random numbers in tests; kernels compile on their first call.
settings.register_profile("emaphm", deadline=None, derandomize=True, max_examples=30)
settings.load_profile("emaphm")


# In the background of a shell without job control, SIGINT is ignored, also by processes that a test
# starts: tests that interrupt a process would wait for ever.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Start with complete examples, the longest tests, and end with `simulation`, the shortest files.

    A long file at the end would leave a process idle.
    """
    place = {Path(__file__).parent: 0, Path(__file__).with_name("simulation"): 2}
    items.sort(key=lambda item: place.get(item.path.parent, 1))


def pytest_collection_finish() -> None:
    """Collect garbage less often, and not among loaded objects: this takes a tenth of the total time."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(20_000)


@pytest.fixture(scope="session")
def healthy() -> Recording:
    """Return all channels of the healthy actuator, with the sensor noise of the demonstration."""
    return simulate(THESIS, Chirp(), noise=0.05)


@pytest.fixture(scope="session")
def shorted() -> Recording:
    """Return all channels of an actuator with a third of phase b shorted."""
    return simulate(THESIS, Chirp(), faults=Faults(short_b=0.3), noise=0.05)


@pytest.fixture(scope="session")
def new_history(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """Return the file of a new history: creating its tables takes ten times as long as opening it."""
    from emaphm.history import History  # imports the database library, which few tests need

    file = tmp_path_factory.mktemp("new") / "history.sqlite"
    History.open(file, create=True).close()
    return file.read_bytes()


@pytest.fixture(scope="module")
def one_search() -> Iterator[None]:
    """Search only once, also if a recording is not explained, to save time in tests of later steps.

    Repeated searches are tested in `tests/estimation/test_restarts.py`.
    """
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(restarts, "MAX_RESTARTS", 0)
        yield


@pytest.fixture(scope="module")
def unrefined() -> Iterator[None]:
    """Accept the end of a search that does not explain a recording, to save time in tests of later steps.

    Refinement by the reference model is tested in `tests/estimation/test_reference_refinement.py`.
    """
    with pytest.MonkeyPatch.context() as patched:
        for module in (restarts, law_fit):
            patched.setattr(module, "refine_by_reference", lambda result, _: result)
        yield


@pytest.fixture(scope="module")
def warm_workers() -> Iterator[None]:
    """Start the workers of this module's tests from a process that has loaded their modules."""
    with warm_processes():
        yield


@pytest.fixture(scope="session")
def forks() -> Iterator[Forks]:
    """Return the process that forks the processes of all Dask clusters."""
    with forking() as process:
        yield process


@pytest.fixture
def no_prognoses(monkeypatch: pytest.MonkeyPatch) -> None:
    """Skip the prognosis of watchers, which takes most of their time and has its own tests."""
    monkeypatch.setattr("emaphm.monitoring.outlook.Outlook.ask", lambda *_: None)


@pytest.fixture
def no_model_error(monkeypatch: pytest.MonkeyPatch) -> None:
    """Skip the estimate of the model error in a calibration, which changes no parameter, to save time.

    The model error is tested in `tests/calibration/test_model_error.py`.
    """
    module = importlib.import_module("emaphm.calibration.calibrate")  # a function has its name
    monkeypatch.setattr(module, "learned_model_error", lambda *_: NOT_LEARNED)


@pytest.fixture
def few_paths(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let a prognosis draw a quarter of its paths, with the few particles of a long history, to save time.

    For tests whose checked numbers do not need all paths.
    """
    module = importlib.import_module("emaphm.prognosis.prognose")  # a function has its name
    few = replace(module.FORECAST, paths=module.FORECAST.paths // 4)
    monkeypatch.setattr(module, "FORECAST", few)
    filtered = replace(module.FILTER, most=module.FILTER.particles)
    monkeypatch.setattr(module, "FILTER", filtered)
    monkeypatch.setattr("emaphm.prognosis.from_fleet.record.FILTER", filtered)


@pytest.fixture
def few_steps(few_paths: None, monkeypatch: pytest.MonkeyPatch) -> None:  # noqa: ARG001 - changes the same
    """Let a prognosis also predict in a quarter of its steps, which take most of its time."""
    module = importlib.import_module("emaphm.prognosis.prognose")  # a function has its name
    few = replace(module.FORECAST, steps=module.FORECAST.steps // 4)
    monkeypatch.setattr(module, "FORECAST", few)


@pytest.fixture
def undrawn_prognosis(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave the figures of a prognosis's report empty, to save time in tests that check only its text.

    The figures are tested in `tests/cli/test_prognose.py`.
    """
    for part in ("health", "life", "fan"):
        monkeypatch.setattr(f"emaphm.report.prognosis.draw_{part}", lambda _: None)
    monkeypatch.setattr("emaphm.report.prognosis.svg", lambda _: b"<svg/>")


@pytest.fixture
def any_delay_shows(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the estimators of `amortized.toys`, which compare no signals, answer as if a delay were visible."""
    monkeypatch.setattr(delays, "DELAYS", replace(delays.DELAYS, least_change=0.0))


@pytest.fixture
def answers_taken(any_delay_shows: None, monkeypatch: pytest.MonkeyPatch) -> None:  # noqa: ARG001 - patches too
    """Accept fast answers of the estimators of `amortized.toys` without correction by a search.

    The conditions of acceptance are tested in `tests/amortized`.
    """
    monkeypatch.setattr("emaphm.amortized.diagnosing._reasons_not_explained", lambda *_, **__: ())
    monkeypatch.setattr("emaphm.amortized.diagnosing.other_explanations", lambda *_: ())
