"""Texts of the report of a diagnosis: headline, table and lists."""

from collections.abc import Sequence
from dataclasses import dataclass

from emaphm.actuator import COMPONENTS, Faults
from emaphm.diagnosis.result import Diagnosis
from emaphm.diagnosis.wording import physical_text
from emaphm.text_table import NOTHING, TextTable

LABELS = {
    "friction": "friction",
    "backlash": "backlash",
    "short_a": "phase a winding",
    "short_b": "phase b winding",
    "short_c": "phase c winding",
    "eccentricity": "rotor eccentricity",
    "eccentricity_phase": "eccentricity direction",
    "gain": "position gain",
}
"""Names of the components for readers."""

FITNESS_UNITS = {"least_squares": "A²", "thesis": "A²·s", "total_least_squares": "A²·s"}


@dataclass(frozen=True)
class Headline:
    """The verdict in a few words, in `sentences`, and as a `kind`: "healthy", "degraded" or "doubtful"."""

    words: str
    sentences: tuple[str, ...]
    kind: str


def headline(diagnosis: Diagnosis) -> Headline:
    """Return the verdict: the degraded, healthy and inconclusive components, and whether it is reliable."""
    degraded, healthy, undecided = (
        _components_with(verdict, diagnosis) for verdict in ("degraded", "healthy", "cannot tell")
    )
    shorts = [
        f"{100 * share:.1f} % of {'another' if i else 'one winding'}"
        for i, share in enumerate(diagnosis.shorts_of_open_phases)
    ]
    sensors = [fault.sentence for fault in diagnosis.sensor_faults]
    findings = (
        _sentence("Size of the faults", [_size(name, diagnosis) for name in degraded]),
        _sentence("Shorted turns, their phases open", shorts),
        _sentence("Healthy", [LABELS[name] for name in healthy]),
        _sentence("Inconclusive", [LABELS[name] for name in undecided]),
    )
    sentences = (*sensors, *(sentence for sentence in findings if sentence))
    explanation = _explanation(diagnosis)
    if not diagnosis.explained:
        words = "Not reliable: the model does not explain this recording."
        return Headline(words, (explanation, *sentences), "doubtful")
    if degraded or shorts:
        open_phases = ["windings (phases open)"] if shorts else []
        words = _sentence("Degraded", [LABELS[name] for name in degraded] + open_phases)
        if sensors:
            words += " A sensor has a fault too."
        return Headline(words, (*sentences, explanation), "degraded")
    finding = "No fault of the actuator found, but of a sensor" if sensors else "No fault found"
    if undecided:
        words = f"{finding}{'; some' if sensors else ', but some'} components are inconclusive."
    else:
        words = f"{finding}." if sensors else "Healthy: no fault found."
    return Headline(words, (*sentences, explanation), "healthy")


def _size(name: str, diagnosis: Diagnosis) -> str:
    """Return the physical size of a degraded component, with the direction of an eccentricity."""
    if not diagnosis.components[name].identifiable:
        return f"that of {LABELS[name]} is not identifiable"
    meanings = physical_text(diagnosis.faults, diagnosis.actuator)
    directed = name == "eccentricity" and diagnosis.components["eccentricity_phase"].identifiable
    return f"{meanings[name]} {meanings['eccentricity_phase']}" if directed else meanings[name]


def _components_with(verdict: str, diagnosis: Diagnosis) -> list[str]:
    return [name for name in COMPONENTS if diagnosis.components[name].verdict == verdict]


def _explanation(diagnosis: Diagnosis) -> str:
    share = f"{100 * diagnosis.relative_residual:.1f} % of the current"
    size = f"Residual of the {diagnosis.model} model: {diagnosis.residual_rms_A:.3g} A rms, {share}."
    if diagnosis.explained:
        return f"Model explains the recording: yes. {size}"
    reasons = "; ".join(diagnosis.reasons)
    return (
        f"Model explains the recording: no. {size} Why: {reasons}. "
        "Do not rely on the values and intervals below. Check the actuator's parameters, the units of the "
        "recording, and the load."
    )


def component_table(diagnosis: Diagnosis, truth: Faults | None) -> TextTable:
    """Return a table with a row per component; the reason of a verdict replaces the physical meaning."""
    meanings = physical_text(diagnosis.faults, diagnosis.actuator)
    components, posterior = diagnosis.components, diagnosis.posterior
    columns: dict[str, list[str]] = {
        "Component": [LABELS[name] for name in components],
        "Estimate": [f"{e.value:z.4f}" if e.identifiable else NOTHING for e in components.values()],
        "95\u00a0% interval": [_interval(e.interval95, e.limits) for e in components.values()],
    }
    if posterior:
        columns["95\u00a0% credible interval"] = [
            _interval(posterior.interval95[name], estimate.limits) for name, estimate in components.items()
        ]
    if truth is not None:
        columns["True value"] = [_true(name, truth) for name in components]
    columns["Verdict"] = [e.verdict for e in components.values()]
    columns["Meaning"] = [e.reason or meanings[name] for name, e in components.items()]
    return TextTable(tuple(columns), tuple(zip(*columns.values(), strict=True)))


def _interval(ends: tuple[float, float], limits: tuple[float, float]) -> str:
    """Return an interval as text, or a dash if it is the full range of the component."""
    low, high = ends
    return NOTHING if ends == limits else f"{low:z.4f} to {high:z.4f}"


def _true(name: str, truth: Faults) -> str:
    has_value = name != "eccentricity_phase" or truth.eccentricity > 0
    return f"{getattr(truth, name):.4f}" if has_value else NOTHING


def inconclusive(diagnosis: Diagnosis) -> list[tuple[str, str]]:
    """Return pairs of the names of inconclusive components that share a reason, and this reason."""
    by_reason: dict[str, list[str]] = {}
    for name, estimate in diagnosis.components.items():
        if estimate.verdict == "cannot tell":
            by_reason.setdefault(estimate.reason, []).append(LABELS[name])
    return [(", ".join(names), reason) for reason, names in by_reason.items()]


def _sentence(opening: str, items: Sequence[str]) -> str:
    return f"{opening}: {', '.join(items)}." if items else ""


def computation(diagnosis: Diagnosis) -> dict[str, str]:
    """Return the facts on the computation of the diagnosis, by name."""
    time = diagnosis.time_s
    interval = (time[-1] - time[0]) / (time.size - 1)
    rows = f"{time.size} rows at {1 / interval:.6g} Hz, {time.size * interval:.4g} s"
    unit = FITNESS_UNITS[diagnosis.fitness_name]
    correction = "none: no bias correction"
    if diagnosis.by_estimator:
        correction = f"{diagnosis.reference_runs}, and those that the estimator has learned from"
    elif diagnosis.reference_runs:
        correction = f"{diagnosis.reference_runs}, to correct the bias of the {diagnosis.model} model"
    sampling = diagnosis.posterior and diagnosis.posterior.diagnostics
    nuisances = (
        f"{name} {estimate}" + ("" if estimate.known else " (not identifiable)")
        for name, estimate in diagnosis.nuisances.items()
    )
    return {
        "Recording": f"{diagnosis.recording}: {rows}",
        "Actuator": f"{diagnosis.actuator.name}, {diagnosis.actuator.coordinates}",
        "Compared channels": ", ".join(diagnosis.channels),
        "Estimated with the faults": ", ".join(nuisances) or "nothing else",
        "Method": diagnosis.method,
        "Model": diagnosis.model,
        "Fitness": f"{diagnosis.fitness:.4g} {unit} ({diagnosis.fitness_name})",
        "Simulations": str(diagnosis.evaluations),
        "Reference runs": correction,
        "Computing time": f"{diagnosis.seconds:.2f} s",
        **({"Posterior": str(sampling)} if sampling else {}),
        "Seed": str(diagnosis.seed),
        "Version": f"emaphm {diagnosis.version}",
    }
