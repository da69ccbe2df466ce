"""Designing a test: the precision that it will give for each fault, and a chirp that gives more."""

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
"""Fault vectors that a precision is predicted for: the kernels advance as many at once."""

SEARCHED, CHOSEN = 0.5, 0.75
"""Shares of the time after which the search and the choice of a finalist are done."""


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
    """Return the precision that `command` will give for each fault, and a better chirp if there is one.

    The search minimises the mean, over faults and over representative fault vectors, of the logarithm of the
    predicted half-width. Of the best few, tests simulated by the reference model choose one, and further
    tests under other faults and noise compare it with the given excitation. It counts as better if its
    intervals are narrower by more than two standard errors, and its errors are not larger by as much.

    Parameters
    ----------
    actuator
        Description of the unit to be tested.
    command, duration
        The excitation given: position of the user [rad; m if linear] as a function of time, and how long
        it lasts [s].
        The default is `Chirp`, over that duration, about 0 or in the middle of the travel where an end stop
        is nearer.
    max_amplitude, max_frequency, max_duration
        Constraints of a better one, [rad] at the user, [Hz], [s]; those of the given one where left out. The
        given one must keep them too, without a search as well.
    initial_position
        Where the shaft rests first, at the user [rad; m if linear], and a better chirp moves about; as for
        `emaphm.simulate` where left out.
    channels
        What will be recorded: "current" and, if any, "voltage", "position", "speed"; or their columns,
        "current_A" and so on.
    noise, sample_rate
        Of the current's sensor, rms [A]; rows a second [Hz].
    candidates
        Chirps to try; 0 to report on the given excitation only.
    tests
        Simulated for the given excitation and for the best found, 4 or more, and half as many, but 4 or
        more, for each finalist; 0 to report predictions only, without `candidates`.
    seed, workers
        The same seed gives the same bits, whatever the number of threads.
    on_progress
        Called with the fraction done, from 0 to 1.

    Raises
    ------
    MethodError, SignalError
        A channel, limit, noise, rate or number is impossible, the given excitation exceeds a limit or moves
        nothing.
    """
    _check_work(candidates, tests, seed)
    setup = TestSetup.of(actuator, channels, noise, sample_rate, workers)
    if not 0 < duration <= LONGEST_S:
        raise SignalError(f"an excitation of {duration:g} s cannot be planned; give up to {LONGEST_S:g} s")
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
        searching = subprogress(on_progress, 0.0, SEARCHED)
        finalists = search_candidates(setup, constraints, planned, faults, candidates, seed, searching)
        choosing = subprogress(on_progress, SEARCHED, CHOSEN)
        best = choose_finalist(setup, finalists, tests, child_seed(seed, "choice"), choosing)
    if not tests:
        return Design(setup, planned, planned, None, candidates, tests, seed)
    # Under faults and noise that have chosen nothing.
    compared = [planned] if best is None else [planned, best]
    confirming = subprogress(on_progress, CHOSEN if candidates else 0.0, 1.0)
    excitations = [one.excitation for one in compared]
    results = simulate_tests(setup, excitations, tests, child_seed(seed, "comparison"), confirming)
    confirmed = [replace(one, simulated=result) for one, result in zip(compared, results, strict=True)]
    gain = None if best is None else Gain.of(results[0], results[1])
    found = confirmed[1] if gain is not None and gain.significant else confirmed[0]
    return Design(setup, confirmed[0], found, gain, candidates, tests, seed)


def _check_work(candidates: int, tests: int, seed: int) -> None:
    """Refuse work that cannot be done, or would show nothing."""
    if seed < 0:
        raise SignalError(f"seed {seed} is negative; give 0 or more")
    if candidates < 0:
        raise MethodError(f"{candidates} candidates cannot be tried; give 0 or more")
    if tests != 0 and tests < FEWEST_TESTS:
        raise MethodError(f"{tests} tests prove nothing; give {FEWEST_TESTS} or more, or 0 for no proof")
    if candidates and not tests:
        raise MethodError(
            "what is found without tests is not proven to be better; give some (--tests), or try no others "
            "(--candidates 0)"
        )
