"""The result of a diagnosis: faults with their uncertainty, nuisances, reasons and settings."""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from emaphm.actuator import NAMES, Actuator, Faults
from emaphm.actuator.lumped_parameters import not_calibrated
from emaphm.arrays import Array
from emaphm.diagnosis.law_parameters import law_parameters, shown_laws, without_laws
from emaphm.diagnosis.load_estimate import LoadEstimate, estimated_load
from emaphm.diagnosis.nuisance_estimate import NuisanceEstimate
from emaphm.diagnosis.selection.settings import DESCRIPTION_ERRORS, ROTOR_ZERO
from emaphm.diagnosis.sensor_faults import SensorFault, sensor_faults
from emaphm.diagnosis.text import (
    fault_rows,
    on_calibration,
    on_fit,
    on_known,
    on_laws,
    on_load,
    on_ripple,
    on_selected,
    on_unit,
    on_unknown,
)
from emaphm.diagnosis.verdict import VERDICT, Z95, Estimate
from emaphm.estimation.space.nuisances import BASELINE
from emaphm.estimation.space.parameter_space import SHORTS
from emaphm.estimation.uncertainty.collinearity import CollinearSet
from emaphm.estimation.uncertainty.model_error import HealthyComparison
from emaphm.estimation.uncertainty.shared_error import shared_covariance
from emaphm.output_files import written_whole
from emaphm.recording.sensor_checks import SensorFinding
from emaphm.text_table import format_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from emaphm.detection.result import DetectorResult
    from emaphm.estimation.posterior.samples import Posterior


ESTIMATOR = "estimator"
"""Method name of a diagnosis by the network of an estimator alone."""


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """The faults that explain a recording.

    Attributes
    ----------
    components
        Estimates of the eight components of `Faults`, in order.
    coordinates, covariance
        Names (d,) of the estimate's coordinates, and its covariance (d, d).
    method, model, fitness_name
        Search method, fitted model, and minimised cost function.
    fitness
        Value of the cost function at the estimate, in its own unit (`emaphm.estimation.cost_functions`).
    residual_rms_A
        Rms of the recorded less the modelled current [A].
    explained
        Whether the estimate explains the recording: `emaphm.diagnosis.explanation.reasons_against`.
    evaluations, reference_runs
        Number of simulations of the fitted model, and of the reference model for corrections and comparisons.
    time_s, recorded, modelled
        Time [s], recorded and modelled current [A], each (samples,).
    channels
        Channels that were compared with the model.
    nuisances
        Other parameters that were estimated together with the faults, by name.
    selected
        Nuisances that were estimated without a request, because they deviate significantly from the
        description; "baseline NAME" are parameters of the actuator that the recording contradicts.
    laws
        Optional laws that the description lacks and with which the residual is clearly smaller. Empty if the
        recording is not explained even so; without laws whose parameters are not identifiable (`with_laws`).
    collinear_sets
        Sets of parameters of which only the combined effect is identifiable.
    moves
        False where the actuator stood still.
    posterior
        Samples of the posterior distribution, if requested.
    recording_notes
        Notes on the recording: how its channels were processed, and cautions.
    sensor_faults
        Faults of sensors.
    model_error
        Comparison of each channel's residual with healthy recordings, if a calibration has learned these.
    reasons
        Why the recording is not explained: sentences without full stop; empty if it is explained.
    healthy_check
        Result of a detector: whether the recording is similar to healthy recordings; if requested.
    """

    components: Mapping[str, Estimate]
    coordinates: tuple[str, ...]
    covariance: Array
    method: str
    model: str
    fitness_name: str
    fitness: float
    residual_rms_A: float
    explained: bool
    evaluations: int
    reference_runs: int
    seconds: float
    seed: int
    recording: str
    actuator: Actuator
    version: str
    time_s: Array
    recorded: Array
    modelled: Array
    channels: tuple[str, ...] = ("current_A",)
    nuisances: Mapping[str, NuisanceEstimate] = field(default_factory=dict)
    collinear_sets: tuple[CollinearSet, ...] = ()
    selected: tuple[str, ...] = ()
    laws: tuple[str, ...] = ()
    moves: bool = True
    posterior: "Posterior | None" = None
    recording_notes: tuple[str, ...] = ()
    sensor_faults: tuple[SensorFault, ...] = ()
    model_error: Mapping[str, HealthyComparison] = field(default_factory=dict)
    reasons: tuple[str, ...] = ()
    healthy_check: "DetectorResult | None" = None

    def with_sensor_faults(self, findings: Sequence[SensorFinding]) -> "Diagnosis":
        """Return the diagnosis with the sensor faults from its estimate and the model-free `findings`."""
        faults = sensor_faults(
            findings,
            self.selected,
            self.nuisances,
            self.collinear_sets,
            self.channels,
            self.actuator,
            explained=self.explained,
        )
        return replace(self, sensor_faults=faults)

    def with_laws(self, laws: Sequence[str]) -> Self:
        """Return the diagnosis with the identified `laws` of its search.

        If the recording is not explained, no law is reported, and no value of its parameters: a law that
        reduces such a residual need not be its cause.
        """
        if self.explained:
            return replace(self, laws=shown_laws(laws, self.nuisances, self.actuator))
        return replace(self, laws=(), nuisances=without_laws(self.nuisances, laws))

    @property
    def by_estimator(self) -> bool:
        """Whether the diagnosis is by the network of an estimator alone."""
        return self.method == ESTIMATOR

    @property
    def faults(self) -> Faults:
        """The estimated faults."""
        return Faults(*(self.components[name].value for name in NAMES))

    @property
    def interval(self) -> dict[str, tuple[float, float]]:
        """The 95 % interval of each component."""
        return {name: estimate.interval95 for name, estimate in self.components.items()}

    @property
    def shared_covariance(self) -> Array | None:
        """Covariance (f, f), f ≤ 8, of the errors of faults that all recordings of the unit have in common.

        It belongs to the first f `coordinates`. The unknown deviations of a unit's parameters, within
        tolerances or a baseline, are the same in all its recordings. None if the parameters are known.
        """
        parameters = [name for name in self.selected if name.startswith(BASELINE)]
        suspected = {name: DESCRIPTION_ERRORS.prior_of(name.removeprefix(BASELINE)) for name in parameters}
        return shared_covariance(self.actuator, self.coordinates, self.covariance, suspected)

    @cached_property
    def load(self) -> LoadEstimate | None:
        """The load over the recording; None if it was not estimated as varying."""
        return estimated_load(self.nuisances, self.coordinates, self.covariance, self.time_s)

    @property
    def shorts_of_open_phases(self) -> tuple[float, ...]:
        """The significant shorts, the largest first, if their assignment to the phases is not identifiable.

        This is the case if the rotor's electrical zero was estimated; otherwise empty
        (`emaphm.diagnosis.explanation.open_phases`).
        """
        if BASELINE + ROTOR_ZERO not in self.selected or not self.explained:
            return ()
        shorts = [self.components[name] for name in SHORTS]
        significant = [
            short.value
            for short in shorts
            if short.value - Z95 * short.standard_error > VERDICT.healthy_margin
        ]
        return tuple(sorted(significant, reverse=True)) if shorts[0].verdict == "cannot tell" else ()

    @property
    def law_parameters(self) -> dict[str, NuisanceEstimate]:
        """The estimated parameters of `laws` in physical units, by name."""
        return law_parameters(self.nuisances, self.laws, self.actuator)

    @property
    def relative_residual(self) -> float:
        """The rms of the residual as a fraction of the rms of the recorded current."""
        size = float(np.sqrt(np.mean(self.recorded**2)))
        return self.residual_rms_A / size if size > 0 else float("inf")

    def to_dict(self) -> dict[str, Any]:
        """Return the content of `emaphm diagnose --json`, ready for `json.dumps`."""
        shared = self.shared_covariance
        return {
            "faults": {name: _fault_dict(estimate) for name, estimate in self.components.items()},
            "k": self.faults.vector.tolist(),
            "nuisances": {name: estimate.to_dict() for name, estimate in self.nuisances.items()},
            "suspected": list(self.selected),
            "laws": list(self.laws),
            "law_parameters": {name: value.to_dict() for name, value in self.law_parameters.items()},
            "moves": self.moves,
            "notes": list(self.recording_notes),
            "sensor_faults": [fault.to_dict() for fault in self.sensor_faults],
            "groups": [
                {"members": list(group.members), "remedies": list(group.resolving)}
                for group in self.collinear_sets
            ],
            "channels": list(self.channels),
            "method": self.method,
            "model": self.model,
            "fitness": self.fitness,
            "fitness_name": self.fitness_name,
            "residual_rms_A": self.residual_rms_A,
            "relative_residual": self.relative_residual,
            "explained": self.explained,
            "reasons": list(self.reasons),
            "evaluations": self.evaluations,
            "reference_runs": self.reference_runs,
            "seconds": round(self.seconds, 4),
            "seed": self.seed,
            "recording": self.recording,
            "actuator": self.actuator.name,
            "not_calibrated": list(not_calibrated(self.actuator)),
            "covariance": {"coordinates": list(self.coordinates), "matrix": self.covariance.tolist()},
            **({} if shared is None else {"shared_covariance": shared.tolist()}),
            **({"posterior": self.posterior.to_dict()} if self.posterior else {}),
            **({"detector": self.healthy_check.to_dict()} if self.healthy_check else {}),
            "version": self.version,
            "model_error": {name: error.to_dict() for name, error in self.model_error.items()},
        }

    def to_json(self, path: str | Path | None = None) -> str:
        """Return the diagnosis as JSON, and write it to `path` if given; `OutputError` if that fails."""
        content = json.dumps(self.to_dict(), indent=2)
        if path is not None:
            with written_whole(path) as temporary:
                temporary.write_text(content + "\n", encoding="utf-8")
        return content

    def plot(self) -> "Figure":
        """Draw the recording against the model, the residual, and the faults with their intervals."""
        from emaphm.plotting.diagnosis import draw_diagnosis

        return draw_diagnosis(self)

    def table(self, truth: Faults | None = None) -> str:
        """Return the components as a text table, with the true values if given."""
        header = ["fault", "estimate", "95 % interval", "verdict", "meaning"]
        if truth is not None:
            header.insert(1, "true")
        return format_table(header, fault_rows(self.components, self.faults, self.actuator, truth))

    def notes(self) -> list[str]:
        """Return the notes on the table, one line each."""
        # Sensor faults found without a model are also among the recording's notes.
        sensor_sentences = {fault.sentence.removesuffix(".") for fault in self.sensor_faults}
        of_recording = [
            f"{self.recording}: {note}." for note in self.recording_notes if note not in sensor_sentences
        ]
        of_sensors = [f"Sensor fault: {fault}" for fault in self.sensor_faults]
        posterior = self.posterior.notes(self.interval) if self.posterior else []
        check = [f"Against healthy recordings: {self.healthy_check.sentence}."] if self.healthy_check else []
        return [*of_recording, *of_sensors, *self._notes_on_estimate(), *posterior, *check]

    def _notes_on_estimate(self) -> Iterator[str]:
        """Yield notes on motion, residual, nuisances, collinear sets and deviations of the unit."""
        yield from on_fit(self.reasons, self.channels, moves=self.moves, explained=self.explained)
        yield from (f"Residual of {name}: {comparison}" for name, comparison in self.model_error.items())
        yield from on_known(self.nuisances, self.load)
        yield from on_load(self.load)
        yield from on_laws(self.laws, self.law_parameters)
        yield from on_ripple(self.law_parameters, self.actuator)
        yield from on_selected(self.selected)
        yield from on_unknown(self.nuisances, self.load, self.collinear_sets, self.channels)
        yield from on_unit(self.nuisances, self.law_parameters, self.subject)
        yield from on_calibration(self.actuator)

    @property
    def subject(self) -> str:
        """Words for the diagnosed data in sentences."""
        return "the recording"

    def summary(self) -> str:
        """Return one line: whether the model explains the recording, the residual, and the effort."""
        verdict = f"{'explains' if self.explained else 'does NOT explain'} {self.subject}"
        return (
            f"The {self.model} model {verdict}: residual {self.residual_rms_A:.3g} A rms "
            f"({100 * self.relative_residual:.1f} % of the current). "
            f"{self.method}, {self.evaluations} simulations, {self.seconds:.2f} s, seed {self.seed}."
        )

    def __str__(self) -> str:
        """Return the text output of `emaphm diagnose`."""
        return "\n".join([self.table(), *self.notes(), self.summary()])


def _fault_dict(estimate: Estimate) -> dict[str, Any]:
    """Return the JSON entry of one component."""
    values = {
        "value": estimate.value,
        "standard_error": estimate.standard_error,
        "interval95": list(estimate.interval95),
        "identifiable": estimate.identifiable,
        "verdict": estimate.verdict,
    }
    return values | ({"reason": estimate.reason} if estimate.reason else {})
