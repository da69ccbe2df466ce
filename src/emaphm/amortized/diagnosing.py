"""Diagnosis by an estimator: its answer alone, or a search that starts at the answer."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from emaphm.actuator import Actuator
from emaphm.actuator.argument import check_actuator
from emaphm.amortized.applicability.delays import delay_clause, shifted_rows
from emaphm.amortized.applicability.likeness import Objections, objections_to
from emaphm.amortized.drawing import PRIOR, SHORTS
from emaphm.amortized.error_prediction.comparison import RUNS, Comparison
from emaphm.amortized.error_prediction.deviations import OTHER_RUNS
from emaphm.amortized.error_prediction.other_explanations import other_explanations
from emaphm.amortized.estimator import Estimator
from emaphm.amortized.networks.mixture import Mixture
from emaphm.blas_threads import one_blas_thread
from emaphm.diagnosis import Diagnosis, diagnose
from emaphm.diagnosis.conclusion import nuisance_estimates
from emaphm.diagnosis.explanation.cautions import cautions
from emaphm.diagnosis.explanation.motion import moves_at
from emaphm.diagnosis.explanation.one_way import undecided_where_one_way
from emaphm.diagnosis.explanation.reasons import reasons_against
from emaphm.diagnosis.result import ESTIMATOR
from emaphm.diagnosis.verdict import estimates
from emaphm.estimation.bias_correction import MAX_CORRECTIONS
from emaphm.estimation.methods import WITH_LEAST_SQUARES
from emaphm.estimation.objective import MapObjective
from emaphm.estimation.posing import problem_of
from emaphm.estimation.posterior.samples import Posterior
from emaphm.estimation.problem import Problem
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.space.parameter_space import ParameterSpace
from emaphm.estimation.starts import Starts
from emaphm.progress import Progress
from emaphm.random_streams import stream
from emaphm.recording import Recording, check_plausible, with_equivalent_current
from emaphm.recording.argument import check_recording
from emaphm.recording.sensor_checks import check_sensors
from emaphm.version import VERSION

CORRECTED = ESTIMATOR + WITH_LEAST_SQUARES
"""Method of a diagnosis whose search started at the network's answer."""

LEAST_WEIGHT, SEPARATION = 0.05, 3.0
"""Least weight of a mixture's component, and least distance from the mean in standard deviations, at which a
search starts there too. With each further start, fewer runs of the reference model are left for the other
starts."""

WIDE, DRAWS = 0.04, 6
"""Standard deviation of a fault above which a search also starts at draws from the answer, and the number of
these draws. The search also does so if all phases are shorted heavily: there, a single descent stops at a
local minimum at a kink."""

FARTHEST = 3.5
"""Largest distance from the answer, in its standard deviations, at which the end of a search from it is
accepted. Farther away, the search has stopped at a kink, or the answer was wrong."""

SAMPLES = 1000
"""Samples of the answer from which its credible intervals are computed."""


@one_blas_thread()
def diagnose_by(
    estimator: Estimator,
    recording: Recording,
    actuator: Actuator,
    *,
    fast: bool = False,
    max_corrections: int = MAX_CORRECTIONS,
    nuisances: Sequence[str] | None = None,
    posterior: bool = False,
    seed: int = 0,
    workers: int | None = None,
    on_progress: Progress | None = None,
) -> Diagnosis:
    """Return the diagnosis of `recording` by the estimator of `actuator`.

    If a sensor's own signal indicates a fault, or the recording differs too much from the training set, the
    recording is diagnosed as without an estimator. `method` is then "hybrid", and a note gives the reason.

    Parameters
    ----------
    fast
        Whether the answer of the networks is accepted without a search if the averaged model explains the
        recording there; `method` is then "estimator". Otherwise a local search starts at the answer, in place
        of the global search, and the bias correction follows: "estimator+lsq".
    max_corrections, nuisances, posterior, seed, workers, on_progress
        As for `emaphm.diagnose`. An answer without a search has the nuisances of the training.

    Raises
    ------
    MethodError
        The estimator is for another actuator, manoeuvre, rate or channels; or as for `emaphm.diagnose`.
    RecordingError
        `recording` is no `Recording`, or its channels differ by orders of magnitude from this actuator's.
    ActuatorError
        `actuator` is no `Actuator`.
    """
    began = time.perf_counter()
    evaluation = _Evaluation.of(estimator, recording, actuator, seed, alone=fast)
    recording, mixture = evaluation.recording, evaluation.mixture
    starts = None
    if evaluation.answer is None:
        reasons = "; ".join(evaluation.reasons)
        note = f"the estimator's answer is not accepted: {reasons}; all of the range was searched"
        recording = recording.with_channels(recording.channels, [note])
    else:
        if fast and not evaluation.reasons:
            return evaluation.answer.diagnosis(recording, seed, began)
        if fast:
            note = f"the estimator's answer was corrected: {'; '.join(evaluation.reasons)}"
            recording = recording.with_channels(recording.channels, [note])
        starts = _starts(mixture, estimator.space, seed)

    def search(recording: Recording, starts: Starts | None) -> Diagnosis:
        return diagnose(
            recording,
            actuator,
            max_corrections=max_corrections,
            nuisances=nuisances,
            seed=seed,
            workers=workers,
            posterior=posterior,
            starts=starts,
            on_progress=on_progress,
        )

    diagnosis = search(recording, starts)
    reason = _reason_to_search_again(mixture, estimator.space, diagnosis)
    if reason is not None:
        note = f"{reason}; all of the range was searched"
        diagnosis = search(recording.with_channels(recording.channels, [note]), None)
    return replace(diagnosis, seconds=time.perf_counter() - began)


@one_blas_thread()
def answer_alone(
    estimator: Estimator, recording: Recording, actuator: Actuator, *, seed: int = 0
) -> Diagnosis | tuple[str, ...]:
    """Return the diagnosis by the networks alone, or the reasons why it is not accepted, a clause each.

    It is `diagnose_by` with `fast`, without the search that follows if the answer is not accepted.

    Parameters
    ----------
    estimator
        An estimator by `emaphm.train_estimator`, or from its file by `Estimator.load`.
    recording, actuator
        A recording of the manoeuvre, and the description, for which the estimator was trained.
    seed
        Source of all randomness.

    Raises
    ------
    MethodError
        The estimator is for another actuator, manoeuvre, rate or channels.
    RecordingError
        The recording's channels differ by orders of magnitude from this actuator's.
    """
    began = time.perf_counter()
    evaluation = _Evaluation.of(estimator, recording, actuator, seed, alone=True)
    if evaluation.answer is None or evaluation.reasons:
        return evaluation.reasons
    return evaluation.answer.diagnosis(evaluation.recording, seed, began)


def _reason_to_search_again(mixture: Mixture, space: ParameterSpace, diagnosis: Diagnosis) -> str | None:
    """Return why the end of a search that started at the answer is not accepted; None if it is accepted.

    An added law is such a reason, because it can also reduce the residual that a wrong answer leaves.
    """
    if diagnosis.method != CORRECTED:
        return None
    name, deviations = _largest_deviation(mixture, space, diagnosis)
    if deviations > FARTHEST:
        return (
            f"least squares led away from the estimator's answer, by {deviations:.2g} of its standard "
            f"deviations in {name}"
        )
    if diagnosis.laws:
        return f"the search from the estimator's answer found laws: {', '.join(diagnosis.laws)}"
    return None


def _largest_deviation(mixture: Mixture, space: ParameterSpace, diagnosis: Diagnosis) -> tuple[str, float]:
    """Return the fault with the largest deviation of a diagnosis from the answer, and this deviation.

    Deviations are in standard deviations of the answer.
    """
    faults = len(space.columns)
    deviations = np.abs(space.points(diagnosis.faults.vector) - mixture.mean)[:faults]
    deviations /= np.sqrt(np.diag(mixture.covariance))[:faults]
    return space.coordinates[int(deviations.argmax())], float(deviations.max())


def _starts(mixture: Mixture, space: ParameterSpace, seed: int) -> Starts:
    """Return the starts of a search: the answer, and draws from it if a descent may stop at a kink."""
    points = mixture.starts(LEAST_WEIGHT, SEPARATION)
    deviations = np.sqrt(np.diag(mixture.covariance))[: len(space.columns)]
    shorts = space.faults(space.project(points[:1]))[0, SHORTS]
    if deviations.max() > WIDE or shorts.min() > PRIOR.heavy_short[0]:
        points = np.vstack([points, mixture.inside(space, DRAWS, stream(seed, "starts from the answer"))])
    return Starts(ESTIMATOR, points, space.coordinates)


def _objective(estimator: Estimator, recording: Recording, actuator: Actuator) -> MapObjective:
    """Return the objective of the averaged model for the recording, in the coordinates of the estimator."""
    problem = problem_of(recording, actuator, workers=1, channels=estimator.setup.channels)
    # The temperature is one of the coordinates that the network has estimated, even if it was recorded.
    return MapObjective.of(replace(problem, temperature_rise_K=0.0), estimator.space)


@dataclass(frozen=True, eq=False)
class _Answer:
    """The networks' answer, and the residual of the averaged model at its mean.

    `moves`: whether the actuator moves there. `reasons`: why the answer is not accepted without a search.
    `compared`: number of recordings that the networks evaluated, which are the recording as it was measured
    and, where delays were tested, with shifted channels.
    """

    mixture: Mixture
    result: SearchResult
    moves: bool
    reasons: tuple[str, ...]
    compared: int

    @classmethod
    def of(cls, mixture: Mixture, objective: MapObjective, seed: int, compared: int, *, alone: bool) -> Self:
        """Return the answer, with the reasons why it is not accepted without a search.

        The averaged model at the answer does not explain the recording, or the faults have another possible
        explanation. Both are checked only if no search follows (`alone`).
        """
        result = SearchResult.at(objective, objective.space.project(mixture.mean))
        moves = moves_at(objective, result.point)
        if not alone:
            return cls(mixture, result, moves, (), compared)
        reasons = _reasons_not_explained(result, seed, moves=moves)
        if moves and not reasons:
            reasons = other_explanations(result, mixture.covariance, seed)
        return cls(mixture, result, moves, reasons, compared)

    def diagnosis(self, recording: Recording, seed: int, began: float) -> Diagnosis:
        """Return the diagnosis by the network alone."""
        objective, point, covariance = self.result.objective, self.result.point, self.mixture.covariance
        problem, space = objective.problem, objective.space
        residual = self.result.fitted_residual[: problem.samples]
        samples = self.mixture.inside(space, SAMPLES, stream(seed, "samples of the answer"))
        averaged, reference = problem.runs.of(problem.model)
        components = undecided_where_one_way(estimates(space, point, covariance), self.result)
        return Diagnosis(
            components=components,
            coordinates=space.coordinates,
            covariance=covariance,
            method=ESTIMATOR,
            model=problem.model.name,
            fitness_name="least_squares",
            fitness=self.result.cost,
            residual_rms_A=float(np.sqrt(np.mean(residual**2))),
            explained=True,
            evaluations=averaged + self.compared * (RUNS + OTHER_RUNS + space.dimensions + 1),
            reference_runs=reference,
            seconds=time.perf_counter() - began,
            seed=seed,
            recording=recording.source,
            actuator=problem.actuator,
            version=VERSION,
            time_s=recording["time_s"],
            recorded=problem.recorded,
            modelled=problem.recorded - residual,
            channels=problem.channels,
            recording_notes=(*recording.notes, *cautions(components, self.result, moves=self.moves)),
            nuisances=nuisance_estimates(objective, point, covariance),
            moves=self.moves,
            posterior=Posterior.of(space, samples, None),
        )


def _reasons_not_explained(result: SearchResult, seed: int, *, moves: bool) -> tuple[str, ...]:
    """Return why the averaged model at an answer does not explain the recording, a clause each."""
    objective = result.objective
    # Jacobians are needed after a correction only.
    none = np.zeros((1, objective.space.dimensions, objective.channel_rows))
    return reasons_against(result, none, {}, seed, moves=moves)


@dataclass(frozen=True, eq=False)
class _Evaluation:
    """The evaluation of a recording by an estimator.

    `answer` is None if it is not accepted even as the start of a search. `reasons` say why it is not, or why
    the averaged model at the answer does not explain the recording; without reasons, it is accepted.
    """

    recording: Recording
    mixture: Mixture
    answer: _Answer | None
    reasons: tuple[str, ...]

    @classmethod
    def of(
        cls, estimator: Estimator, recording: Recording, actuator: Actuator, seed: int, *, alone: bool
    ) -> Self:
        """Return the evaluation of the recording; errors as in `diagnose_by`.

        Whether the answer is accepted, and whether a channel is delayed by a row, is tested only if no search
        follows (`alone`): a search tests both itself.
        """
        check_recording(recording)
        check_actuator(actuator)
        check_plausible(recording, actuator)
        recording = with_equivalent_current(recording, actuator)
        estimator.check(recording, actuator)
        objective = _objective(estimator, recording, actuator)
        rows = shifted_rows(estimator, recording) if alone else estimator.rows(recording)
        answers = estimator.answers(rows, objective.problem.inputs)
        mixture = answers[0]
        objections = _objections_to_any_answer(estimator, recording, actuator, objective.problem)
        if not objections.reasons:
            rng = stream(seed, "likeness of the recording")
            comparison = Comparison.of(estimator.setup, objective.problem.inputs, rows, answers, rng)
            objections = objections_to(estimator, comparison[:1])
            if alone and not (objections.reasons or objections.rare):
                delay = delay_clause(estimator, comparison)
                if delay is not None:
                    objections = Objections(_delay_or_not_explained(delay, mixture, objective, seed))
        if objections.reasons:
            return cls(recording, mixture, None, (*objections.rare, *objections.reasons))
        answer = _Answer.of(mixture, objective, seed, len(rows), alone=alone)
        return cls(recording, mixture, answer, (*objections.rare, *answer.reasons))


def _delay_or_not_explained(
    delay: str, mixture: Mixture, objective: MapObjective, seed: int
) -> tuple[str, ...]:
    """Return why an answer is not accepted if a shift in time reduces the residual, stated in `delay`.

    If the answer does not explain the recording, answers for shifted recordings may have smaller residuals by
    chance. The reasons why it is not explained are returned then, in place of the delay.
    """
    result = SearchResult.at(objective, objective.space.project(mixture.mean))
    return _reasons_not_explained(result, seed, moves=moves_at(objective, result.point)) or (delay,)


def _objections_to_any_answer(
    estimator: Estimator, recording: Recording, actuator: Actuator, problem: Problem
) -> Objections:
    """Return the objections to any answer: a fault in a sensor's own signal, or another initial state."""
    findings = check_sensors(recording, actuator).findings
    if findings:
        return Objections(tuple(finding.sentence.removesuffix(".") for finding in findings))
    if not estimator.setup.starts_there(problem.start):
        position = f"{estimator.setup.initial_position:g}"
        text = "it starts at another position, or after a motion; the training's manoeuvre starts at rest at"
        return Objections((f"{text} {position}",))
    return Objections(())
