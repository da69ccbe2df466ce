"""Design of a test: the predicted precision of each fault, and the search for a better chirp."""

from collections.abc import Sequence
from dataclasses import replace

from emaphm.actuator import Actuator, Chirp, Command
from emaphm.blas_threads import one_blas_thread
from emaphm.errors import MethodError, SignalError
from emaphm.estimation.discrepancy import LONGEST_S
from emaphm.experiment.candidate_search import (
    FEWEST_TESTS,
    PlannedTest,
    choose_finalist,
    search_candidates,
)
from emaphm.experiment.constraints import Constraints
from emaphm.experiment.excitation import Excitation
from emaphm.experiment.predicted_precision import predicted_precision
from emaphm.experiment.result import Design
from emaphm.experiment.simulated_tests import Gain, simulate_tests
from emaphm.experiment.test_setup import TestSetup
from emaphm.progress import Progress, subprogress
from emaphm.random_streams import child_seed

VECTORS = 16
"""Fault vectors for which the precision is predicted; the kernels advance this number at once."""

SEARCH_END, SELECTION_END = 0.5, 0.75
"""Shares of the time at the end of the search, and of the selection of a finalist."""


@one_blas_thread()
def design(
    actuator: Actuator,
    command: Command | None = None,
    *,
    duration: float = 0.5,
    max_amplitude: float | None = None,
    max_frequency: float | None = None,
    max_duration: float | None = None,
    initial_position: float | None = None,
    channels: Sequence[str] = ("current",),
    noise: float = 0.05,
    sample_rate: float = 5000.0,
    candidates: int = 48,
    tests: int = 12,
    seed: int = 0,
    workers: int | None = None,
    on_progress: Progress | None = None,
) -> Design:
    """Return the precision of each fault for a test with `command`, and a better chirp if there is one.

    The search minimises the mean, over faults and over representative fault vectors, of the logarithm of the
    predicted half-width. Tests simulated by the reference model select one of the best chirps. Further tests
    with other faults and noise compare it with the given excitation. It is better if its intervals are
    narrower by more than two standard errors, and its errors are not larger by more than this.

    Parameters
    ----------
    actuator
        Description of the unit to be tested.
    command, duration
        The given excitation: position of the user [rad; m if linear] as a function of time, and its duration
        [s]. The default is a `Chirp` of this duration about 0, or about the middle of the travel if an end
        stop is too near.
    max_amplitude, max_frequency, max_duration
        Constraints of a better excitation, [rad] at the user, [Hz], [s]; the default is those of the given
        excitation. The given excitation must satisfy them too, even without a search.
    initial_position
        Initial rest position at the user [rad; m if linear], and centre of a better chirp; default as for
        `emaphm.simulate`.
    channels
        Recorded channels: "current" and, if any, "voltage", "position", "speed"; or their columns,
        "current_A" and so on.
    noise, sample_rate
        Noise of the current sensor, rms [A]; sample rate [Hz].
    candidates
        Number of chirps to evaluate; 0 to evaluate the given excitation only.
    tests
        Number of simulated tests, at least 4, of the given excitation and of the best chirp; half as many, at
        least 4, of each finalist. 0 for predictions only, without `candidates`.
    seed, workers
        The same seed gives the same bits, whatever the number of threads.
    on_progress
        Called with the fraction done, from 0 to 1.

    Raises
    ------
    MethodError, SignalError
        A channel, limit, noise, rate or number is impossible, or the given excitation exceeds a limit or does
        not move the actuator.
    """
    _check_work(candidates, tests, seed)
    setup = TestSetup.of(actuator, channels, noise, sample_rate, workers)
    if not 0 < duration <= LONGEST_S:
        raise SignalError(f"a manoeuvre of {duration:g} s cannot be planned; give up to {LONGEST_S:g} s")
    if command is None:
        about = actuator.mechanics.start_for(-Chirp().amplitude, Chirp().amplitude)
        command = Chirp(duration=duration, about=about)
    given = Excitation(command, duration, initial_position)
    faults = setup.faults(VECTORS, child_seed(seed, "prediction"))
    constraints = Constraints.of(
        setup, given, max_amplitude, max_frequency, max_duration, searching=candidates > 0
    )
    planned, best = PlannedTest(given, predicted_precision(setup, given, faults, seed)), None
    if candidates:
        searching = subprogress(on_progress, 0.0, SEARCH_END)
        finalists = search_candidates(setup, constraints, planned, faults, candidates, seed, searching)
        choosing = subprogress(on_progress, SEARCH_END, SELECTION_END)
        best = choose_finalist(setup, finalists, tests, child_seed(seed, "choice"), choosing)
    if not tests:
        return Design(setup, planned, planned, None, candidates, tests, seed)
    # With other faults and noise than those of the selection, which would favour the selected chirp.
    compared = [planned] if best is None else [planned, best]
    confirming = subprogress(on_progress, SELECTION_END if candidates else 0.0, 1.0)
    excitations = [test.excitation for test in compared]
    results = simulate_tests(setup, excitations, tests, child_seed(seed, "comparison"), confirming)
    tested = [replace(test, simulated=result) for test, result in zip(compared, results, strict=True)]
    gain = None if best is None else Gain.of(results[0], results[1])
    better = tested[1] if gain is not None and gain.significant else tested[0]
    return Design(setup, tested[0], better, gain, candidates, tests, seed)


def _check_work(candidates: int, tests: int, seed: int) -> None:
    """Raise an error for impossible numbers, and for a search whose result would not be tested."""
    if seed < 0:
        raise SignalError(f"seed {seed} is negative; give 0 or more")
    if candidates < 0:
        raise MethodError(f"{candidates} candidates cannot be tried; give 0 or more")
    if tests != 0 and tests < FEWEST_TESTS:
        raise MethodError(
            f"--tests {tests}: too few simulated tests to check a prediction; give {FEWEST_TESTS} or more, "
            "or 0 for no check"
        )
    if candidates and not tests:
        raise MethodError(
            "without tests, a chirp is not proven to be better; give some (--tests), or search no chirps "
            "(--candidates 0)"
        )
