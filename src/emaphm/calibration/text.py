"""Tables and notes of a calibration as text."""

import math
from collections.abc import Collection, Mapping, Sequence

from emaphm.actuator import NAMES
from emaphm.actuator.lumped_parameters import LUMPED_PARAMETERS
from emaphm.actuator.quantity import unit_for
from emaphm.actuator.unit.baseline import SIGNED
from emaphm.actuator.unit.model_error import CHANNELS, ModelError
from emaphm.calibration.findings import Parameter, RecordingResult
from emaphm.calibration.law_selection import LawTrial
from emaphm.diagnosis.verdict import VERDICT, Z95
from emaphm.estimation.space.nuisances import unit_of
from emaphm.estimation.uncertainty.model_error import error_inflation
from emaphm.recording.schema import SCHEMA
from emaphm.text_table import NOTHING, format_table

WORSE = 1.5
"""Misfit ratio above which a note states that a recording is fitted worse jointly than alone."""


def parameter_table(parameters: Mapping[str, Parameter], collinear: Collection[str], recordings: int) -> str:
    """Return the table of parameters with standard errors, and marks such as "not identifiable"."""
    source = "this recording" if recordings == 1 else "these recordings"
    rows = []
    for name, p in parameters.items():
        marks = [] if p.identifiable else [f"not identifiable from {source}{_known_within(name, p)}"]
        marks = ["at its bound"] if p.at_bound else marks
        marks += ["doubtful"] if p.doubtful else []
        marks += ["collinear"] if name in collinear else []
        error = f"{p.standard_error:.2g}" if p.identifiable or name in SIGNED else NOTHING
        unit = f"{p.unit}  ({', '.join(marks)})" if marks else p.unit
        rows.append((name, _rounded(p.value, p.standard_error), error, unit))
    return format_table(("parameter", "value", "std. error", "unit"), rows)


def _known_within(name: str, parameter: Parameter) -> str:
    """Return a phrase with the factor within which a positive, not identifiable parameter is known."""
    if name in SIGNED or parameter.factor is None:
        return ""
    return f": known within a factor of {parameter.factor:.2g} only"


def _rounded(value: float, error: float) -> str:
    """Return a value as text with the digits that its error justifies, at least one and at most six."""
    known = math.ceil(math.log10(abs(value / error))) + 1 if value and error else 1
    return f"{value:.{min(max(known, 1), 6)}g}"


def law_table(trials: Sequence[LawTrial]) -> str:
    """Return the table of laws in the order of their trials."""
    rows = [
        (
            " + ".join((*trial.given, trial.law)),
            f"{100 * trial.training_error:.4g} %",
            NOTHING if trial.held_out_error is None else f"{100 * trial.held_out_error:.4g} %",
            f"{trial.seconds:.1f} s",
            f"{trial.evaluations}",
            "yes" if trial.chosen else "",
        )
        for trial in trials
    ]
    return format_table(("laws", "training error", "held-out error", "time", "simulations", "chosen"), rows)


def recording_notes(
    recordings: Sequence[RecordingResult],
    birge_ratio: float | None,
    scattered: bool,
    error_correlation: float | None,
) -> list[str]:
    """Return a line on the estimates of each recording, and on the agreement of the recordings."""
    lines = []
    for result in recordings:
        source, own = result.replay.recording.source, {**result.nuisances, **result.own}
        if own:
            coordinates = result.replay.actuator.coordinates
            values = ", ".join(
                f"{name} {value:.4g}" if name in result.own else _with_unit(name, value, coordinates)
                for name, value in own.items()
            )
            lines.append(f"Estimated with the parameters in {source}: {values}.")
        if result.misfit_ratio is not None and result.misfit_ratio > WORSE:
            lines.append(
                f"{source} alone would be fitted {result.misfit_ratio:.2g} times as well as with the others."
            )
    if birge_ratio is not None:
        lines.append(
            f"The {len(recordings)} recordings scatter {birge_ratio:.2g} times as much as their own standard "
            "errors explain" + ("; those above include it." if scattered else ", no more than by chance.")
        )
    if error_correlation is not None:
        lines.append(
            "The residuals of recordings of the same manoeuvre are correlated "
            f"({error_correlation:.2f}): their common part is not averaged away in the standard errors, and "
            "does not appear in the scatter."
        )
    return lines


def kept_notes(kept: Mapping[str, float], coordinates: str, estimated: Collection[str]) -> list[str]:
    """Return a line on the parameters that were `kept` as described while others were `estimated`."""
    if not kept:
        return []
    values = ", ".join(
        f"{name} {value:.4g} {unit_for(LUMPED_PARAMETERS[name], coordinates)}".removesuffix(" -")
        + (" (in its described ratio to coulomb)" if name == "static" and "coulomb" in estimated else "")
        for name, value in kept.items()
    )
    return [f"Kept from the description, not measured by this calibration: {values}."]


def model_error_notes(learned: ModelError, coordinates: str, *, laws_tried: bool) -> list[str]:
    """Return lines on the model's error that was learned from recordings left out of the fit, if any."""
    errors = {name: error for name in CHANNELS if (error := learned.of(name)) is not None}
    lines = []
    if errors:
        sizes = ", ".join(
            f"{name} {error.floor:.2g} {unit_for(SCHEMA[name].unit, coordinates)} at rest"
            for name, error in errors.items()
        )
        lines.append(f"Error of the model in addition to noise, in recordings left out of the fit: {sizes}.")
    if learned.faults is not None:
        apparent = {name: learned.faults.of(name) for name in NAMES if learned.faults.of(name) > 0}
        if apparent:
            values = ", ".join(f"{name} {value:.2g}" for name, value in apparent.items())
            lines.append(f"In recordings left out, the model's error resembles faults: {values}.")
        if (largest := max(apparent.values(), default=0.0)) > VERDICT.hidden_fault:
            reach = Z95 * largest * error_inflation(learned.faults.recordings)
            advice = "Calibrate on more manoeuvres" if laws_tried else "Let laws be tried (--laws auto)"
            lines.append(
                f"Faults up to some {reach:.1g} may not be found by this description: it lacks a law, or the "
                f"controller differs. {advice}, or name a law (--laws)."
            )
    return lines


def _with_unit(name: str, value: float, coordinates: str) -> str:
    unit = unit_of(name, coordinates)
    return f"{name} {value:+.3g}" if unit == "-" else f"{name} {value:+.3g} {unit}"
