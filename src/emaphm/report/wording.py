"""What a report says: its headline, its table, its lists."""

from collections.abc import Sequence
from dataclasses import dataclass

from emaphm.actuator import Faults
from emaphm.diagnosis.result import Diagnosis
from emaphm.diagnosis.wording import physical_text

LABELS = {
    "friction": "friction",
    "backlash": "backlash",
    "short_a": "winding of phase a",
    "short_b": "winding of phase b",
    "short_c": "winding of phase c",
    "eccentricity": "rotor centring",
    "eccentricity_phase": "eccentricity direction",
    "gain": "position gain",
}
"""The components in words that go with "healthy" and "degraded" alike."""

FITNESS_UNITS = {"least_squares": "A²", "thesis": "A²·s", "total_least_squares": "A²·s"}

NOTHING = "–"


@dataclass(frozen=True)
class Headline:
    """The verdict: in a few words, in `sentences`, and as a `kind`: "healthy", "degraded" or "doubtful"."""

    words: str
    sentences: tuple[str, ...]
    kind: str


@dataclass(frozen=True)
class Row:
    """One component in the table, as text; `sampled` and `true` are empty where there is none."""

    name: str
    label: str
    found: str
    interval: str
    sampled: str
    true: str
    verdict: str
    meaning: str


def headline(diagnosis: Diagnosis) -> Headline:
    """Return the verdict on `diagnosis`: what is degraded, what is healthy, what nobody can tell."""
    degraded, healthy, untold = (
        _called(verdict, diagnosis) for verdict in ("degraded", "healthy", "cannot tell")
    )
    meanings = physical_text(diagnosis.faults, diagnosis.actuator)
    if diagnosis.components["eccentricity_phase"].identifiable:
        meanings["eccentricity"] += f" {meanings['eccentricity_phase']}"
    findings = (
        _sentence("Away from healthy by more than the interval", [meanings[name] for name in degraded]),
        _sentence("Healthy", [LABELS[name] for name in healthy]),
        _sentence("This recording cannot tell", [LABELS[name] for name in untold]),
    )
    told = tuple(sentence for sentence in findings if sentence)
    explanation = _explanation(diagnosis)
    if not diagnosis.explained:
        return Headline("The model does not explain this recording.", (explanation, *told), "doubtful")
    if degraded:
        words = _sentence("Degraded", [LABELS[name] for name in degraded])
        return Headline(words, (*told, explanation), "degraded")
    words = "No fault found in what this recording can tell." if untold else "Healthy: no fault found."
    return Headline(words, (*told, explanation), "healthy")


def _called(verdict: str, diagnosis: Diagnosis) -> list[str]:
    """Return the components of that verdict; a direction is no fault of its own and is left out."""
    components = diagnosis.components.items()
    return [name for name, e in components if e.verdict == verdict and name != "eccentricity_phase"]


def _explanation(diagnosis: Diagnosis) -> str:
    share = f"{100 * diagnosis.relative_residual:.1f} % of the current"
    size = f"its residual is {diagnosis.residual_rms_A:.3g} A rms, {share}"
    if diagnosis.explained:
        return f"The {diagnosis.model} model explains the recording: {size}."
    return (
        f"The {diagnosis.model} model does not explain the recording: {size}. No combination of these faults "
        "reproduces it, so the values and intervals below are not to be relied on; check the actuator's "
        "parameters, the units of the recording, and the load."
    )


def table(diagnosis: Diagnosis, truth: Faults | None) -> list[Row]:
    """Return the table's rows, one for each component; the reason stands in for what is not known."""
    meanings = physical_text(diagnosis.faults, diagnosis.actuator)
    rows = []
    for name, estimate in diagnosis.components.items():
        low, high = estimate.interval95
        bounded = (low, high) != (0.0, 1.0)
        rows.append(
            Row(
                name,
                LABELS[name],
                f"{estimate.value:.4f}" if estimate.identifiable else NOTHING,
                f"{low:.4f} to {high:.4f}" if bounded else NOTHING,
                _sampled(name, diagnosis),
                _true(name, truth),
                estimate.verdict,
                estimate.reason or meanings[name],
            )
        )
    return rows


def _sampled(name: str, diagnosis: Diagnosis) -> str:
    if diagnosis.posterior is None:
        return ""
    low, high = diagnosis.posterior.interval95[name]
    return NOTHING if (low, high) == (0.0, 1.0) else f"{low:.4f} to {high:.4f}"


def _true(name: str, truth: Faults | None) -> str:
    if truth is None:
        return ""
    if name == "eccentricity_phase" and truth.eccentricity == 0:
        return NOTHING
    return f"{getattr(truth, name):.4f}"


def untold(diagnosis: Diagnosis) -> list[tuple[str, str]]:
    """Return pairs of the components that share a reason why nobody can tell, in words, and that reason."""
    by_reason: dict[str, list[str]] = {}
    for name, estimate in diagnosis.components.items():
        if estimate.reason:
            by_reason.setdefault(estimate.reason, []).append(LABELS[name])
    return [(", ".join(names), reason) for reason, names in by_reason.items()]


def _sentence(opening: str, items: Sequence[str]) -> str:
    return f"{opening}: {', '.join(items)}." if items else ""


def computation(diagnosis: Diagnosis) -> dict[str, str]:
    """Return what it took: how the diagnosis was computed, item by item."""
    time = diagnosis.time_s
    interval = (time[-1] - time[0]) / (time.size - 1)
    rows = f"{time.size} rows at {1 / interval:.6g} Hz, {time.size * interval:.4g} s"
    unit = FITNESS_UNITS[diagnosis.fitness_name]
    correction = "none"
    if diagnosis.reference_runs:
        correction = f"{diagnosis.reference_runs}, by which the {diagnosis.model} model's bias was measured"
    return {
        "Recording": f"{diagnosis.recording}: {rows}",
        "Actuator": f"{diagnosis.actuator.name}, {diagnosis.actuator.coordinates}",
        "Compared": ", ".join(diagnosis.channels),
        "Estimated besides": ", ".join(
            f"{name} {estimate}" + ("" if estimate.known else " (the recording hardly tells)")
            for name, estimate in diagnosis.nuisances.items()
        )
        or "nothing",
        "Method": diagnosis.method,
        "Model": diagnosis.model,
        "Fitness": f"{diagnosis.fitness:.4g} {unit} ({diagnosis.fitness_name})",
        "Simulations": str(diagnosis.evaluations),
        "Reference runs": correction,
        "Computing time": f"{diagnosis.seconds:.2f} s",
        **({"Posterior": str(diagnosis.posterior.diagnostics)} if diagnosis.posterior else {}),
        "Seed": str(diagnosis.seed),
        "Version": f"emaphm {diagnosis.version}",
    }
