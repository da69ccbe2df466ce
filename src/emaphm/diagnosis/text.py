"""The text of a diagnosis: rows of its table, and notes."""

import math
from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import replace

from emaphm.actuator import Actuator, Faults
from emaphm.actuator.laws import LAWS
from emaphm.actuator.lumped_parameters import not_calibrated
from emaphm.actuator.unit.baseline import PARTS, SIGNED
from emaphm.diagnosis.load_estimate import LoadEstimate, is_of_load
from emaphm.diagnosis.nuisance_estimate import NuisanceEstimate, of_unit
from emaphm.diagnosis.selection.settings import ROTOR_ZERO
from emaphm.diagnosis.selection.varying_load import LOADS
from emaphm.diagnosis.verdict import Estimate
from emaphm.diagnosis.wording import physical_text
from emaphm.estimation.sensors.sensor_model import sensor_error
from emaphm.estimation.space.nuisances import BASELINE
from emaphm.estimation.uncertainty.collinearity import CollinearSet

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

SIGNIFICANT = 3.0
"""Number of standard errors by which a torque ripple must differ from 0 for its cause to be named."""


def fault_rows(
    components: Mapping[str, Estimate], faults: Faults, actuator: Actuator, truth: Faults | None
) -> list[tuple[str, ...]]:
    """Return table rows: component, truth if given, value, interval, verdict, and reason or meaning."""
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


def on_fit(reasons: Sequence[str], channels: Sequence[str], *, moves: bool, explained: bool) -> Iterator[str]:
    """Yield that the actuator does not move, and why the recording is not explained."""
    if not moves:
        yield SHOWN_STILL if "position_rad" in channels else STANDS_STILL
    if not explained:
        yield NOT_EXPLAINED
        yield from (f"Not explained: {reason}." for reason in reasons)


def on_known(nuisances: Mapping[str, NuisanceEstimate], load: LoadEstimate | None) -> Iterator[str]:
    """Yield the known nuisances, without the parts of a varying `load` (`on_load`)."""
    of_recording = _of_recording(nuisances, load)
    if known := ", ".join(f"{name} {estimate}" for name, estimate in of_recording.items() if estimate.known):
        yield f"Estimated with the faults: {known}."


def on_unknown(
    nuisances: Mapping[str, NuisanceEstimate],
    load: LoadEstimate | None,
    collinear_sets: Sequence[CollinearSet],
    channels: Sequence[str],
) -> Iterator[str]:
    """Yield the collinear sets, and the nuisances that are not identifiable from the `channels`."""
    yield from (f"Known only in combination: {group}" for group in collinear_sets)
    collinear = {name for group in collinear_sets for name in group.members}
    of_recording = _of_recording(nuisances, load)
    if unknown := [
        name for name, estimate in of_recording.items() if not estimate.known and name not in collinear
    ]:
        yield (
            f"Not identifiable from {', '.join(channels)}: {', '.join(unknown)}. The intervals "
            "include the prior uncertainty. Record more channels, or the quantity itself."
        )


def _of_recording(
    nuisances: Mapping[str, NuisanceEstimate], load: LoadEstimate | None
) -> dict[str, NuisanceEstimate]:
    """Return the nuisances without parameters of the unit and without parts of a varying `load`."""
    unit = of_unit(nuisances)
    return {
        name: estimate
        for name, estimate in nuisances.items()
        if name not in unit and not (load and is_of_load(name))
    }


def on_load(load: LoadEstimate | None) -> Iterator[str]:
    """Yield the estimate of a varying load, and its other possible causes."""
    if not load:
        return
    yield (
        f"The load {load}; it was estimated together with the faults. If it is recorded as load_Nm, the "
        "faults are known better."
    )
    if load.is_constant:
        yield "This load is larger than expected: state its usual size as 'load' under [nuisances]."
    elif not load.steps:
        yield "Viscous friction that differs from the description (cold grease) may have the same effect."


def on_laws(names: Sequence[str], values: Mapping[str, NuisanceEstimate]) -> Iterator[str]:
    """Yield the laws that the description lacks, the `values` of their parameters, and the remedy."""
    if not names:
        return
    laws = [LAWS[name] for name in names]
    text = (
        f"Explained best by laws that the description lacks: {', '.join(law.name for law in laws)}; without "
        "them, their effects would appear as faults."
    )
    if values:
        text += f" Found: {', '.join(f'{name} {_marked(estimate)}' for name, estimate in values.items())}."
    if calibrated := [law.name for law in laws if not law.by_faults]:
        text += (
            " If this persists, calibrate the healthy actuator "
            f"(emaphm calibrate --laws {','.join(calibrated)})."
        )
    for law in laws:
        if law.by_faults:
            section = PARTS[law.parameters[0]][0]
            text += (
                f" No calibration finds {law.name}; if this persists, give {', '.join(law.parameters)} in "
                f"[{section}] of the actuator's file."
            )
    yield text


def on_ripple(values: Mapping[str, NuisanceEstimate], actuator: Actuator) -> Iterator[str]:
    """Yield the orders of the torque ripple in `values`, and another cause of that once per electrical turn.

    A zero o of the current sensor of a phase makes a torque of -k o s(P θ), whatever the current.
    """
    if "ripple1_cos" not in values or not actuator.three_phases:
        return
    orders = [harmonic.order for harmonic in LAWS["cogging"].added_to(actuator).ripple]
    listed = f"{', '.join(map(str, orders[:-1]))} and {orders[-1]}"
    yield f"ripple1 to ripple{len(orders)} have {listed} periods per turn of the motor."
    if actuator.pole_pairs not in orders:
        return
    name = f"ripple{orders.index(actuator.pole_pairs) + 1}"
    parts = [values[part] for part in (f"{name}_cos", f"{name}_sin") if part in values]
    if any(abs(part.value) > SIGNIFICANT * part.standard_error for part in parts):
        yield (
            f"{name}, once per electrical turn, may also be due to zeros of the drive's current sensors: "
            "check them without current."
        )


def on_selected(selected: Sequence[str]) -> Iterator[str]:
    """Yield the parameters that were estimated without a request, and the remedy."""
    of_recording = [
        name for name in selected if not (sensor_error(name) or name.startswith(BASELINE) or name in LOADS)
    ]
    if of_recording:
        yield (
            "Also estimated, because it deviates significantly from the description: "
            f"{', '.join(of_recording)}. "
            "If this persists, correct the actuator's file; if taken as known, the deviation would appear as "
            "faults."
        )
    of_description = [name.removeprefix(BASELINE) for name in selected if name.startswith(BASELINE)]
    if ROTOR_ZERO in of_description:
        yield (
            "The rotor's electrical zero deviates from the description and was estimated. A sixth of a turn "
            "more explains the recording equally well, so the assignment of the phases is open. Give "
            "rotor_zero in [electrical] of the actuator's file: with the estimate, later recordings have the "
            "same assignment."
        )
    if parameters := [name for name in of_description if name != ROTOR_ZERO]:
        one_of = ", at least one of which deviates" if len(parameters) > 1 else ""
        yield (
            f"Also estimated, because the recording contradicts the description: {', '.join(parameters)}"
            f"{one_of}. If this persists, calibrate the healthy unit (emaphm calibrate), or state under "
            "[tolerances] how far it may deviate; if taken as exact, the deviation would appear as faults."
        )


def on_unit(
    nuisances: Mapping[str, NuisanceEstimate], law_parameters: Container[str], subject: str
) -> Iterator[str]:
    """Yield the estimated parameters of the unit, and those that `subject` does not identify.

    Parameters of laws that the description lacks are omitted (`on_laws`).
    """
    unit = {name.removeprefix(BASELINE): estimate for name, estimate in of_unit(nuisances).items()}
    described = {name: estimate for name, estimate in unit.items() if name not in law_parameters}
    if known := [_deviation(name, estimate) for name, estimate in described.items() if estimate.known]:
        yield f"Deviation of the unit from its description: {', '.join(known)}."
    if unknown := [name for name, estimate in described.items() if not estimate.known]:
        yield f"Not identifiable from {subject}: {', '.join(unknown)} of the unit."


def on_calibration(actuator: Actuator) -> Iterator[str]:
    """Yield the parameters that the calibration of the unit has not estimated."""
    if kept := not_calibrated(actuator):
        yield (
            f"The calibration has not measured {', '.join(kept)}: taken as described. A deviation of the "
            "unit in these parameters would appear as faults."
        )


def _deviation(name: str, estimate: NuisanceEstimate) -> str:
    """Return the deviation of a parameter of the unit, in percent if its logarithm is estimated."""
    if name in SIGNED:
        return f"{name} {_marked(estimate)}"
    factor = math.exp(estimate.value)
    percentage = replace(
        estimate, value=100 * (factor - 1), standard_error=100 * factor * estimate.standard_error, unit="%"
    )
    return f"{name} {_marked(percentage)}"


def _marked(estimate: NuisanceEstimate) -> str:
    """Return the estimate as text, marked if it is not identifiable."""
    return f"{estimate}{'' if estimate.known else ' (not identifiable)'}"
