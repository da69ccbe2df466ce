"""A diagnosis in words: the rows of its table, and the notes that go with it."""

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


def on_fit(reasons: Sequence[str], channels: Sequence[str], *, moves: bool, explained: bool) -> Iterator[str]:
    """Yield that the actuator stands still, and why the recording is not explained."""
    if not moves:
        yield SHOWN_STILL if "position_rad" in channels else STANDS_STILL
    if not explained:
        yield NOT_EXPLAINED
        yield from (f"Not explained: {reason}." for reason in reasons)


def on_known(nuisances: Mapping[str, NuisanceEstimate], load: LoadEstimate | None) -> Iterator[str]:
    """Yield what was estimated with the faults, and is known; of a `load` that varies see `on_load`."""
    own = _of_recording(nuisances, load)
    if known := ", ".join(f"{name} {estimate}" for name, estimate in own.items() if estimate.known):
        yield f"Estimated with the faults: {known}."


def on_unknown(
    nuisances: Mapping[str, NuisanceEstimate],
    load: LoadEstimate | None,
    collinear_sets: Sequence[CollinearSet],
    channels: Sequence[str],
) -> Iterator[str]:
    """Yield what is known only in combination, and what the `channels` do not show at all."""
    yield from (f"Known only in combination: {one}" for one in collinear_sets)
    collinear = {name for one in collinear_sets for name in one.members}
    own = _of_recording(nuisances, load)
    if unknown := [name for name, one in own.items() if not one.known and name not in collinear]:
        yield (
            f"Not identifiable from {', '.join(channels)}: {', '.join(unknown)}. The intervals "
            "include the prior uncertainty. Record more channels, or the quantity itself."
        )


def _of_recording(
    nuisances: Mapping[str, NuisanceEstimate], load: LoadEstimate | None
) -> dict[str, NuisanceEstimate]:
    """Return the nuisances that are neither parameters of the unit nor parts of a `load` that varies."""
    unit = of_unit(nuisances)
    return {
        name: one for name, one in nuisances.items() if name not in unit and not (load and is_of_load(name))
    }


def on_load(load: LoadEstimate | None) -> Iterator[str]:
    """Yield what was estimated of a load that varies, and what it may be in truth."""
    if not load:
        return
    yield (
        f"The load {load}; it was estimated with the faults. Recorded as load_Nm, it is known, and the "
        "faults better."
    )
    if load.is_constant:
        yield "That is more than expected: state by 'load' under [nuisances] how large it may be."
    elif not load.steps:
        yield "Other viscous friction than described, as of cold grease, may look like this load."


def on_laws(names: Sequence[str], values: Mapping[str, NuisanceEstimate]) -> Iterator[str]:
    """Yield what to do about the laws that the description lacks, with the `values` of their parameters."""
    if not names:
        return
    laws = [LAWS[name] for name in names]
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
    yield text


def on_selected(selected: Sequence[str]) -> Iterator[str]:
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


def on_unit(
    nuisances: Mapping[str, NuisanceEstimate], law_parameters: Container[str], subject: str
) -> Iterator[str]:
    """Yield what `subject` shows of the parameters of the unit, and which it does not show.

    But those of laws that the description lacks (`on_laws`).
    """
    unit = {name.removeprefix(BASELINE): one for name, one in of_unit(nuisances).items()}
    described = {name: one for name, one in unit.items() if name not in law_parameters}
    if shown := [_deviation(name, one) for name, one in described.items() if one.known]:
        yield f"Deviation of the unit from its description: {', '.join(shown)}."
    if unseen := [name for name, one in described.items() if not one.known]:
        yield f"Known no better than before {subject}: {', '.join(unseen)} of the unit."


def on_calibration(actuator: Actuator) -> Iterator[str]:
    """Yield which parameters a calibration of the unit has not measured."""
    if kept := not_calibrated(actuator):
        yield (
            f"The calibration has not measured {', '.join(kept)}: taken as described; a unit that differs "
            "there reads as faults."
        )


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
