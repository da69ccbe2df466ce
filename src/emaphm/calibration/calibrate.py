"""Calibrating a healthy unit: its physical parameters, from one recording or several, and how well known."""

import time
from collections.abc import Mapping, Sequence

import numpy as np

from emaphm.actuator import Actuator
from emaphm.actuator.baseline import SIGNED, Baseline
from emaphm.actuator.lumped_parameters import (
    LUMPED_PARAMETERS,
    check_lumped_parameters,
    with_lumped_parameters,
)
from emaphm.actuator.quantity import unit_for
from emaphm.arrays import Array
from emaphm.calibration.random_effects import random_effects
from emaphm.calibration.result import Calibration, Parameter
from emaphm.calibration.single_recording import UnitEstimate, estimate_unit, unit_objective
from emaphm.errors import MethodError
from emaphm.estimation.bias_correction import MAX_CORRECTIONS
from emaphm.estimation.nuisances import NuisanceSet
from emaphm.estimation.parameter_variation import ParameterVariation, sizes, varied
from emaphm.estimation.replay import Replay, replay
from emaphm.progress import Progress, subprogress
from emaphm.recording import Recording, check_plausible

LARGEST_ERROR = 0.5
"""A parameter with a larger relative standard error is called not identifiable."""

CALIBRATED = ", calibrated"
"""What the name of a calibrated actuator ends with."""


def calibrate(
    recordings: Recording | Sequence[Recording],
    actuator: Actuator,
    free: Sequence[str],
    *,
    nuisances: Sequence[str] | None = None,
    max_corrections: int = MAX_CORRECTIONS,
    seed: int = 0,
    workers: int | None = None,
    on_progress: Progress | None = None,
) -> Calibration:
    """Return the parameters `free` of a healthy unit that explain `recordings`, and the calibrated actuator.

    Every channel counts that a diagnosis would compare. Each recording is fitted by itself, its nuisances
    under their priors; a random-effects meta-analysis of all is the calibrated actuator's baseline, and so
    the prior of later diagnoses.

    Parameters
    ----------
    recordings
        Of the healthy unit; lengths, commands and channels may differ.
    actuator
        The description to start from; its values need only be right within a factor of 3 or so. A baseline
        of its own is replaced by that of these recordings.
    free
        Names from `emaphm.actuator.baseline.LUMPED_PARAMETERS`; the others keep their values.
        Static friction keeps its ratio to dynamic friction unless it is free itself.
    nuisances
        What is unknown of each recording: as in `emaphm.diagnose`. One that cannot be
        separated from a free parameter is left out: a load where `offset` is free.
    max_corrections
        Most corrections of the model's bias by the reference model, as in `emaphm.diagnose`.
    seed
        Of the starting points.

    Raises
    ------
    MethodError
        There is no recording; no parameter, or an unknown one, is free; one needs a section that the
        actuator lacks, or starts at zero, where its size is not known; the actuator's baseline holds a
        parameter that is not free; or a nuisance is unknown or cannot be separated from a free parameter.
    RecordingError
        A recording cannot be of this actuator, by orders of magnitude.
    """
    began = time.perf_counter()
    given = (recordings,) if isinstance(recordings, Recording) else tuple(recordings)
    names = tuple(dict.fromkeys(free))
    _check(given, actuator, names)
    bare = actuator.model_copy(update={"baseline": None})
    unit = ParameterVariation.free(bare, names)
    for recording in given:
        check_plausible(recording, bare)
    objectives = [unit_objective(recording, bare, unit, nuisances, workers) for recording in given]
    found = []
    for i, objective in enumerate(objectives):
        progress = subprogress(on_progress, i / len(given), (i + 1) / len(given))
        found.append(estimate_unit(objective, max_corrections, seed, progress))
    combined = random_effects(
        np.array([one.of(names)[0] for one in found]),
        np.array([one.of(names)[1] for one in found]),
        unit.priors,
    )
    days = tuple(one.nuisances_given(names, combined.mean) for one in found)
    size = sizes(bare, names)
    values = {
        name: float(varied(bare, name, variation))
        for name, variation in zip(names, size * combined.mean, strict=True)
    }
    if "static" in values:
        # Below dynamic friction it has no effect, so the search may have left it anywhere there.
        values["static"] = max(values["static"], values.get("coulomb", bare.mechanics.dynamic_friction))
    calibrated = with_lumped_parameters(
        bare, values, name=f"{actuator.name.removesuffix(CALIBRATED)}{CALIBRATED}"
    )
    baseline = Baseline.of(
        names, np.outer(size, size) * combined.covariance, tuple(one.source for one in given)
    )
    runs = [one.objective.problem.runs.of(one.objective.problem.model)[0] for one in found]
    return Calibration(
        _parameters(values, np.sqrt(np.diag(combined.covariance)), size, actuator.coordinates),
        calibrated.model_copy(update={"baseline": baseline}),
        tuple(
            _replayed(one, recording, calibrated, day)
            for one, recording, day in zip(found, given, days, strict=True)
        ),
        days,
        combined.birge_ratio,
        sum(runs),
        time.perf_counter() - began,
        seed,
    )


def _parameters(
    values: Mapping[str, float], errors: Array, size: Array, coordinates: str
) -> dict[str, Parameter]:
    """Return the parameters with standard errors, from those of their variations in units of `size` (p,)."""
    return {
        name: Parameter(
            value,
            float(error * (factor if name in SIGNED else value)),
            unit_for(LUMPED_PARAMETERS[name], coordinates),
            identifiable=bool(error < LARGEST_ERROR),
        )
        for (name, value), error, factor in zip(values.items(), errors, size, strict=True)
    }


def _check(recordings: Sequence[Recording], actuator: Actuator, free: tuple[str, ...]) -> None:
    """Refuse what cannot be calibrated, before the work."""
    if not recordings:
        raise MethodError("no recording to calibrate from; give one of the healthy unit, or several")
    if not free:
        raise MethodError(f"no parameter to calibrate; name some of {', '.join(LUMPED_PARAMETERS)}")
    check_lumped_parameters(actuator, free)
    for name in actuator.baseline.names if actuator.baseline else ():
        if name not in free:
            raise MethodError(
                f"actuator '{actuator.name}' has a baseline of '{name}', which calibrating without it "
                f"would lose; free '{name}' too, or start from the description before it was calibrated"
            )


def _replayed(
    estimate: UnitEstimate, recording: Recording, calibrated: Actuator, day: Mapping[str, float]
) -> Replay:
    """Return the recording replayed by the calibrated model, under the nuisances of that `day`."""
    nuisances = NuisanceSet.of(calibrated, tuple(day), recording.names)
    values = {name: np.asarray(value) for name, value in day.items()}
    rise = estimate.objective.problem.temperature_rise_K
    changed = nuisances.lumped_parameters(calibrated, values, rise)
    parameters = {name: float(value) for name, value in changed.items()}
    return replay(recording, with_lumped_parameters(calibrated, parameters) if parameters else calibrated)
