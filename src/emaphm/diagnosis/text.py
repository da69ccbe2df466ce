"""A diagnosis in words: the rows of its table, and the notes that go with it."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from emaphm.actuator import Actuator, Faults
from emaphm.actuator.laws import LAWS, Law
from emaphm.actuator.lumped_parameters import not_calibrated
from emaphm.actuator.unit.baseline import PARTS, SIGNED
from emaphm.diagnosis.load_estimate import is_of_load
from emaphm.diagnosis.nuisance_estimate import NuisanceEstimate, of_unit
from emaphm.diagnosis.selection.settings import ROTOR_ZERO
from emaphm.diagnosis.selection.varying_load import LOADS
from emaphm.diagnosis.verdict import Estimate
from emaphm.diagnosis.wording import physical_text
from emaphm.estimation.sensors.sensor_model import sensor_error
from emaphm.estimation.space.nuisances import BASELINE

if TYPE_CHECKING:
    from emaphm.diagnosis.result import Diagnosis

STANDS_STILL = (
    "The actuator does NOT move: the command is constant, or the actuator is jammed, too weak or switched "
    "off. A recording at rest has almost no information on its faults."
)
SHOWN_STILL = (
    "The recorded position shows no motion, or only noise: the command is constant, the actuator is jammed, "
    "too weak or switched off, or position_rad has no signal. A recording at rest has almost no information "
    "on the faults."
)
NOT_EXPLAINED = (
    "The recording is not explained: either something else than these faults acts, a channel or the "
    "description is wrong, or the search failed. No component is therefore called healthy or degraded. "
    "Values from a data sheet need their [tolerances] in the description, or a calibration."
)


def fault_rows(
    components: Mapping[str, Estimate], faults: Faults, actuator: Actuator, truth: Faults | None
) -> list[tuple[str, ...]]:
    """Return rows of text: component, truth if given, value, interval, verdict, meaning or reason."""
    meanings = physical_text(faults, actuator)
    rows = []
    for name, estimate in components.items():
        low, high = estimate.interval95
        row = [
            name,
            f"{estimate.value:z.4f}" if estimate.identifiable else "-",
            "-" if estimate.unconstrained else f"{low:z.4f} to {high:z.4f}",
            estimate.verdict,
            estimate.reason or meanings[name],
        ]
        if truth is not None:
            row.insert(1, f"{getattr(truth, name):.4f}")
        rows.append(tuple(row))
    return rows


def _on_laws(laws: Sequence[Law], values: Mapping[str, NuisanceEstimate]) -> str:
    """Return what to do about the laws that the description lacks, with the `values` of their parameters."""
    text = (
        f"Explained best by laws that the description lacks: {', '.join(law.name for law in laws)}; without, "
        "they would read as faults."
    )
    if values:
        text += f" Found: {', '.join(f'{name} {_marked(one)}' for name, one in values.items())}."
    if seen := [law.name for law in laws if not law.by_faults]:
        text += (
            f" If this persists, calibrate the healthy actuator (emaphm calibrate --laws {','.join(seen)})."
        )
    for law in laws:
        if law.by_faults:
            section = PARTS[law.parameters[0]][0]
            text += (
                f" No calibration finds {law.name}; if this persists, give {', '.join(law.parameters)} in "
                f"[{section}] of the actuator's file."
            )
    return text


def notes(diagnosis: "Diagnosis") -> list[str]:
    """Return lines on motion, residual, nuisances, collinear sets and the unit's deviations."""
    nuisances, load = diagnosis.nuisances, diagnosis.load
    of_laws, collinear_sets = diagnosis.law_parameters, diagnosis.collinear_sets
    unit = of_unit(nuisances)
    over_time = {name for name in nuisances if load and is_of_load(name)}
    known = {
        name: estimate
        for name, estimate in nuisances.items()
        if estimate.known and name not in unit and name not in over_time
    }
    collinear = {name for one in collinear_sets for name in one.members}
    unknown = [name for name in nuisances if name not in known.keys() | unit.keys() | collinear | over_time]
    lines = []
    if not diagnosis.moves:
        lines.append(SHOWN_STILL if "position_rad" in diagnosis.channels else STANDS_STILL)
    if not diagnosis.explained:
        lines += [NOT_EXPLAINED, *(f"Not explained: {reason}." for reason in diagnosis.reasons)]
    lines += [f"Residual of {name}: {one}" for name, one in diagnosis.model_error.items()]
    if known:
        values = ", ".join(f"{name} {estimate}" for name, estimate in known.items())
        lines.append(f"Estimated with the faults: {values}.")
    if load:
        lines.append(
            f"The load {load}; it was estimated with the faults. Recorded as load_Nm, it is known, and the "
            "faults better."
        )
        if load.is_constant:
            lines.append("That is more than expected: state by 'load' under [nuisances] how large it may be.")
        elif not load.steps:
            lines.append("Other viscous friction than described, as of cold grease, may look like this load.")
    if diagnosis.laws:
        lines.append(_on_laws([LAWS[name] for name in diagnosis.laws], of_laws))
    lines += _on_selected(diagnosis.selected)
    lines += [f"Known only in combination: {one}" for one in collinear_sets]
    if unknown:
        lines.append(
            f"Not identifiable from {', '.join(diagnosis.channels)}: {', '.join(unknown)}. The intervals "
            "include the prior uncertainty. Record more channels, or the quantity itself."
        )
    described = {name.removeprefix(BASELINE): one for name, one in unit.items()}
    described = {name: one for name, one in described.items() if name not in of_laws}
    lines += _on_unit(described, diagnosis.subject)
    if kept := not_calibrated(diagnosis.actuator):
        lines.append(
            f"The calibration has not measured {', '.join(kept)}: taken as described; a unit that differs "
            "there reads as faults."
        )
    return lines


def _on_selected(selected: Sequence[str]) -> Iterator[str]:
    """Yield what to do about the parameters that were estimated although nobody asked to."""
    of_recording = [
        name for name in selected if not (sensor_error(name) or name.startswith(BASELINE) or name in LOADS)
    ]
    if of_recording:
        yield (
            "Also estimated, because it deviates significantly from the description: "
            f"{', '.join(of_recording)}. "
            "If this persists, correct the actuator's file; taken as known, it would read as faults."
        )
    of_description = [name.removeprefix(BASELINE) for name in selected if name.startswith(BASELINE)]
    if ROTOR_ZERO in of_description:
        yield (
            "The rotor's electrical zero is not where the description puts it, and was estimated; a sixth of "
            "a turn more explains the recording as well, so which phase is which stays open. Give "
            "rotor_zero in [electrical] of the actuator's file: the estimate names the phases of later "
            "recordings alike."
        )
    if parameters := [name for name in of_description if name != ROTOR_ZERO]:
        one_of = ", one of which at least is off" if len(parameters) > 1 else ""
        yield (
            f"Also estimated, because the recording contradicts the description: {', '.join(parameters)}"
            f"{one_of}. If this persists, calibrate the healthy unit (emaphm calibrate), or state under "
            "[tolerances] how far it may be off; taken as exact, it would read as faults."
        )


def _on_unit(described: Mapping[str, NuisanceEstimate], subject: str) -> Iterator[str]:
    """Yield what `subject` shows of the parameters of the unit, and which it does not show."""
    if shown := [_deviation(name, one) for name, one in described.items() if one.known]:
        yield f"Deviation of the unit from its description: {', '.join(shown)}."
    if unseen := [name for name, one in described.items() if not one.known]:
        yield f"Known no better than before {subject}: {', '.join(unseen)} of the unit."


def _deviation(name: str, estimate: NuisanceEstimate) -> str:
    """Return by how much the unit's parameter `name` is off: in percent, where its logarithm is estimated."""
    if name in SIGNED:
        return f"{name} {_marked(estimate)}"
    factor = math.exp(estimate.value)
    share = replace(
        estimate, value=100 * (factor - 1), standard_error=100 * factor * estimate.standard_error, unit="%"
    )
    return f"{name} {_marked(share)}"


def _marked(estimate: NuisanceEstimate) -> str:
    return f"{estimate}{'' if estimate.known else ' (not identifiable)'}"
