"""Calibration of a healthy unit: its physical parameters and laws, by one fit of one or more recordings."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from emaphm.actuator import Actuator
from emaphm.actuator.argument import check_actuator
from emaphm.actuator.lumped_parameters import with_lumped_parameters
from emaphm.actuator.unit.baseline import Baseline
from emaphm.actuator.unit.model_error import NOT_LEARNED
from emaphm.arrays import Array
from emaphm.blas_threads import one_blas_thread
from emaphm.calibration.campaign import CampaignRow, Recordings, campaign_rows, check_row
from emaphm.calibration.conditions import check_nuisances
from emaphm.calibration.description import AUTO, Description, Laws, described_with_laws
from emaphm.calibration.findings import (
    Parameter,
    RecordingResult,
    found_parameters,
    found_recordings,
    found_values,
    set_aside_warnings,
)
from emaphm.calibration.law_selection import parameters_of
from emaphm.calibration.model_error.learned import learned_model_error
from emaphm.calibration.motion.fit import motion_fit
from emaphm.calibration.motion.loop import Loop, LoopChoice, chosen_loop
from emaphm.calibration.motion.result import (
    calibrated_by_motion,
    described_for_motion,
    motion_alone,
    motion_collinear,
    motion_covariance,
    motion_parameters,
    motion_recordings,
)
from emaphm.calibration.reference_laws import sensor_lag
from emaphm.calibration.reference_laws.breakaway import with_breakaway
from emaphm.calibration.reference_laws.shaft import fit_description, with_shaft_that_shows
from emaphm.calibration.result import Calibration
from emaphm.calibration.separation import collinear_parameters
from emaphm.calibration.unit_fit import FitSettings, UnitFit
from emaphm.calibration.warnings.earlier import earlier_warnings
from emaphm.calibration.warnings.one_way import one_way_warnings, open_members, with_open
from emaphm.calibration.warnings.units_and_signs import calibration_warnings, unit_or_sign
from emaphm.calibration.warnings.unmodelled import unmodelled_warnings
from emaphm.errors import EmaphmError, MethodError
from emaphm.estimation.bias_correction import MAX_CORRECTIONS
from emaphm.estimation.space.parameter_variation import sizes
from emaphm.progress import Progress, subprogress
from emaphm.recording import check_plausible
from emaphm.recording.content import check_each_once
from emaphm.recording.sensor_checks.command_noise import with_smoothed_command

CALIBRATED = ", calibrated"
"""Suffix of the name of a calibrated actuator."""


@one_blas_thread()
def calibrate(
    recordings: Recordings,
    actuator: Actuator,
    free: Sequence[str] | None = None,
    *,
    laws: Laws = None,
    loop: Loop = "auto",
    nuisances: Sequence[str] | None = None,
    max_corrections: int = MAX_CORRECTIONS,
    seed: int = 0,
    workers: int | None = None,
    on_progress: Progress | None = None,
) -> Calibration:
    """Return the parameters `free` of a healthy unit that explain `recordings`, and the calibrated actuator.

    All recordings are fitted together: they share the parameters, and each recording has its own nuisances,
    with their priors, or known values. The compared channels are those of a diagnosis. If the recordings
    scatter more than their errors explain, the standard errors include the scatter, and a parameter in which
    recordings contradict each other is called doubtful. The estimates and their covariance become the
    baseline of the calibrated actuator, which is the prior of later diagnoses.

    Parameters
    ----------
    recordings
        Recordings of the healthy unit; lengths, commands and channels may differ. A `CampaignRow` adds known
        values of one recording, or names parameters to estimate for that recording alone.
    actuator
        Description to start from. The search covers a factor of 30 about the value of a positive parameter
        and starts within a factor of 3: if the description deviates more, the search may miss the best fit.
        An existing baseline and model error are replaced by those of these recordings; a warning names
        recordings whose information is lost, and contradictions to the existing baseline.
    free
        Names from `emaphm.actuator.unit.baseline.LUMPED_PARAMETERS`. Other parameters keep their values,
        except parameters with a tolerance, which are also free in closed loop. Static friction keeps its
        ratio to dynamic friction unless it is free itself. By default, the parameters with a tolerance and
        those of an existing baseline; with `laws`, the usual parameters that the recordings identify.
    laws
        Names of laws to add to the description, with free parameters; "auto" tries all laws and adds, one at
        a time, laws that lower the error in recordings left out of the fit.
    loop
        "closed" simulates the controller from the command, and compares every other channel. "measured"
        needs no controller: the recorded position is the input, and the current, voltage or duty is compared
        (`emaphm.estimation.inverse_dynamics`). "auto" is closed loop, unless the gains observed in a
        recording contradict the description.
    nuisances
        Unknowns of each recording, as in `emaphm.diagnose`. A nuisance that cannot be separated from a free
        parameter is left out, for example a load if `offset` is free.
    max_corrections
        Largest number of corrections of the model's bias by the reference model, as in `emaphm.diagnose`.
    seed, workers
        Seed of the starting points, and number of threads; the same seed gives the same bits for any number.
    on_progress
        Called with the fraction done, from 0 to 1, in closed loop.

    Raises
    ------
    MethodError
        There is no recording; no parameter or an unknown parameter is free; a free parameter needs a section
        that the actuator lacks, or has the value 0, so that its size is unknown; the actuator's baseline
        contains a parameter that is not free; a nuisance or law is unknown, or cannot be separated from a
        free parameter; the known values of a recording contradict each other; laws are to be chosen from one
        recording; or measured motion is requested and does not identify a free parameter.
    RecordingError
        A recording is no `Recording`, its values deviate by orders of magnitude from this actuator's, or two
        recordings are the same.
    ActuatorError
        `actuator` is no `Actuator`.
    """
    began = time.perf_counter()
    rows = campaign_rows(recordings)
    check_actuator(actuator)
    names = _free_parameters(free, laws, actuator)
    bare = actuator.model_copy(update={"baseline": None, "model_error": NOT_LEARNED})
    _check(rows, bare, names, nuisances)
    rows = tuple(replace(row, recording=with_smoothed_command(row.recording, bare)) for row in rows)
    known = actuator.tolerances.deviations if actuator.tolerances else {}
    settings = FitSettings(nuisances, max_corrections, seed, workers, known=known)
    choice = chosen_loop(loop, rows, bare, names or ())
    if choice.loop == "measured":
        try:
            by_motion = _by_motion(rows, actuator, names, laws, choice, settings, began)
            return _with_earlier_warnings(by_motion, actuator)
        except EmaphmError as error:
            if loop == "measured":
                hints = [hint for row in rows for hint in unit_or_sign(row, bare)]
                raise type(error)("; ".join([str(error), *dict.fromkeys(hints)])) from None
            reason = f"{choice.reason}; closed loop nevertheless: {error}"
            choice = LoopChoice("closed", reason)
    share = 0.0 if laws is None else 0.5
    description = described_with_laws(rows, bare, names, laws, settings, subprogress(on_progress, 0.0, share))
    if laws == AUTO:
        description = with_shaft_that_shows(rows, description, settings)
        description = sensor_lag.with_lag_that_shows(rows, description, settings)
    _check_described(rows, actuator, description)
    lag = None
    if sensor_lag.NAME in description.free and max_corrections > 0:
        lag = sensor_lag.found_lag(rows, description, settings)
        description = lag.description
    fitting = subprogress(on_progress, share, 1.0)
    description, fit = fit_description(rows, description, settings, fitting)
    scanned = {} if lag is None else {sensor_lag.NAME: lag.parameter}
    calibration = _result(rows, description, fit, scanned, choice, settings, began)
    return _with_earlier_warnings(calibration, actuator)


def _with_earlier_warnings(calibration: Calibration, before: Actuator) -> Calibration:
    """Return the calibration with warnings on an earlier calibration in the description `before`."""
    added = earlier_warnings(before, calibration.actuator)
    return replace(calibration, warnings=(*calibration.warnings, *added))


def _free_parameters(free: Sequence[str] | None, laws: Laws, actuator: Actuator) -> tuple[str, ...] | None:
    """Return the parameters that are free, None if they depend on what the recordings identify."""
    if free is not None:
        return tuple(dict.fromkeys(free))
    if laws is not None:
        return None
    return actuator.uncertain_parameters or None


def _check(
    rows: Sequence[CampaignRow],
    actuator: Actuator,
    free: tuple[str, ...] | None,
    nuisances: Sequence[str] | None,
) -> None:
    """Raise an error for recordings that cannot be calibrated, before the fit."""
    if not rows:
        raise MethodError("no recording to calibrate from; give one of the healthy unit, or several")
    check_nuisances(nuisances, free or ())
    check_each_once(row.recording for row in rows)
    for row in rows:
        check_plausible(row.recording, actuator)


def _check_described(rows: Sequence[CampaignRow], actuator: Actuator, description: Description) -> None:
    """Raise an error if a parameter of the baseline is not free, or a row contradicts the description."""
    for name in actuator.baseline.names if actuator.baseline else ():
        if name not in description.free:
            raise MethodError(
                f"actuator '{actuator.name}' has a baseline of '{name}', which calibrating without it "
                f"would lose; free '{name}' too, or start from the description before it was calibrated"
            )
    for row in rows:
        check_row(row, description.actuator, description.free)


def _by_motion(
    rows: Sequence[CampaignRow],
    actuator: Actuator,
    free: tuple[str, ...] | None,
    laws: Laws,
    choice: LoopChoice,
    settings: FitSettings,
    began: float,
) -> Calibration:
    """Return the calibration by measured motion; raises the errors of `calibrate`."""
    bare = actuator.model_copy(update={"baseline": None, "model_error": NOT_LEARNED})
    description = described_for_motion(rows, bare, free, laws)
    _check_described(rows, actuator, description)
    fit = motion_fit(rows, description.actuator, description.free, settings.nuisances)
    calibrated = calibrated_by_motion(fit, description.actuator, _name_of(actuator))
    covariance, alone = (
        motion_covariance(fit, description.actuator),
        motion_alone(fit, description.actuator),
    )
    parameters = motion_parameters(fit, covariance, description.actuator)
    recording_results = motion_recordings(fit, rows, calibrated)
    baseline = _baseline(tuple(parameters), covariance, rows, recording_results)
    return Calibration(
        parameters,
        calibrated.model_copy(update={"baseline": baseline}),
        recording_results,
        None if alone is None else alone.meta.birge_ratio,
        scattered=alone is not None and bool(np.any(alone.meta.scatter)),
        collinear_sets=motion_collinear(fit, parameters),
        evaluations=0,
        seconds=time.perf_counter() - began,
        seed=settings.seed,
        laws=tuple(law.name for law in description.laws),
        unexcited=_unexcited(description, parameters),
        loop=choice,
        error_correlation=fit.found.error_correlation,
        warnings=calibration_warnings(rows, recording_results, description.actuator),
    )


def _baseline(
    names: tuple[str, ...],
    covariance: Array,
    rows: Sequence[CampaignRow],
    recording_results: Sequence[RecordingResult],
) -> Baseline:
    """Return the baseline, the prior of later diagnoses, with the sources and loads of its recordings."""
    sources = tuple(row.recording.source for row in rows)
    return Baseline.of(names, covariance, sources, tuple(result.load for result in recording_results))


def _name_of(actuator: Actuator) -> str:
    return f"{actuator.name.removesuffix(CALIBRATED)}{CALIBRATED}"


def _unexcited(description: Description, parameters: Mapping[str, Parameter]) -> dict[str, str]:
    """Return the laws that the recordings do not identify, each with a manoeuvre that would."""
    return {
        law.name: law.excited_by
        for law in description.laws
        if not any(parameters[name].identifiable for name in parameters_of(law, description.actuator))
    }


def _result(
    rows: Sequence[CampaignRow],
    description: Description,
    fit: UnitFit,
    scanned: Mapping[str, Parameter],
    choice: LoopChoice,
    settings: FitSettings,
    began: float,
) -> Calibration:
    """Return the calibration of a closed-loop fit; `scanned` are parameters that were estimated before it."""
    actuator = description.actuator
    fit, at_rest = with_breakaway(fit, settings.seed)
    values = found_values(fit, actuator)
    calibrated = with_lumped_parameters(actuator, values, name=_name_of(actuator))
    collinear = collinear_parameters(fit, calibrated, settings.seed)
    open_parameters = open_members(fit, collinear)
    fit = with_open(fit, open_parameters)
    size = sizes(actuator, fit.free)
    recording_results = found_recordings(fit, rows, calibrated)
    baseline = _baseline(fit.free, np.outer(size, size) * fit.covariance, rows, recording_results)
    # The tolerances of a data sheet refer to its own values, not to the estimates.
    known = calibrated.model_copy(update={"baseline": baseline})
    known = known.model_copy(update={"tolerances": known.open_tolerances})
    parameters = {**found_parameters(fit, values, rows, actuator), **scanned}
    problems = [term.objective.problem for term in fit.joint.terms]
    model_error = learned_model_error(rows, fit, actuator, known, settings)
    sources = [row.recording.source for row in rows]
    unmodelled = unmodelled_warnings(fit, sources, model_error, laws_tried=bool(description.selection))
    return Calibration(
        parameters=parameters,
        actuator=known.model_copy(update={"model_error": model_error}),
        recordings=recording_results,
        birge_ratio=None if fit.uncertainty.alone is None else fit.uncertainty.alone.meta.birge_ratio,
        scattered=fit.contradictions is not None and bool(np.any(fit.contradictions.covariance)),
        collinear_sets=collinear,
        evaluations=sum(problem.runs.of(problem.model)[0] for problem in problems),
        seconds=time.perf_counter() - began,
        seed=settings.seed,
        laws=tuple(law.name for law in description.laws),
        selection=description.selection,
        unexcited=_unexcited(description, parameters),
        loop=choice,
        error_correlation=fit.uncertainty.error_correlation,
        warnings=(
            *one_way_warnings(open_parameters),
            *set_aside_warnings(fit, rows, actuator),
            *unmodelled,
            *at_rest,
            *calibration_warnings(rows, recording_results, actuator),
        ),
        law_notes=description.law_notes,
    )
