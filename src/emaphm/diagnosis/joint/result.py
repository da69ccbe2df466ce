"""The result of a joint diagnosis: faults of one unit, and the fit of each of its recordings."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from emaphm.actuator import NAMES
from emaphm.diagnosis.load_estimate import LoadEstimate, is_of_load
from emaphm.diagnosis.nuisance_estimate import NuisanceEstimate
from emaphm.diagnosis.result import Diagnosis
from emaphm.diagnosis.text import NOT_EXPLAINED
from emaphm.text_table import format_table


@dataclass(frozen=True, eq=False)
class JointRecording:
    """One recording of a joint diagnosis.

    Attributes
    ----------
    name
        Name of the file.
    channels
        Channels that were compared with the model.
    explained
        Whether the estimate with the common faults explains this recording.
    residual_rms_A, relative_residual
        Rms of the recorded less the modelled current [A], and as a fraction of the recorded current's rms.
    misfit_ratio
        Ratio of the rms residual with the common faults to the rms residual of the separate fit.
    contradicts
        Whether the separate estimate of this recording contradicts the others.
    alone
        The faults (8,) of the separate estimate.
    nuisances
        Nuisances of this recording.
    load
        The load over the recording; None if it was not estimated as varying.
    """

    name: str
    channels: tuple[str, ...]
    explained: bool
    residual_rms_A: float
    relative_residual: float
    misfit_ratio: float
    contradicts: bool
    alone: tuple[float, ...]
    nuisances: Mapping[str, NuisanceEstimate]
    load: LoadEstimate | None = None

    def to_dict(self) -> dict[str, Any]:
        """Return the recording's entry in the JSON of the diagnosis."""
        return {
            "recording": self.name,
            "channels": list(self.channels),
            "explained": self.explained,
            "residual_rms_A": self.residual_rms_A,
            "relative_residual": self.relative_residual,
            "misfit_ratio": self.misfit_ratio,
            "contradicts": self.contradicts,
            "k_alone": list(self.alone),
            "nuisances": {name: estimate.to_dict() for name, estimate in self.nuisances.items()},
        }

    @property
    def row(self) -> tuple[str, ...]:
        """The recording's row of the text table."""
        load_text = [f"load {self.load}"] if self.load else []
        nuisance_texts = [
            f"{name} {estimate}"
            for name, estimate in self.nuisances.items()
            if estimate.known and not (self.load and is_of_load(name))
        ]
        return (
            self.name,
            "yes" if self.explained else "no",
            f"{100 * self.relative_residual:.1f} %",
            f"{self.misfit_ratio:.2f}",
            "yes" if self.contradicts else "no",
            ", ".join([*load_text, *nuisance_texts]),
        )


def on_contradictions(recordings: Sequence[JointRecording], contradicted: Sequence[str]) -> Iterator[str]:
    """Yield why recordings that contradict each other are not explained: sentences without a full stop.

    `contradicted` are the components in which they differ. If single recordings contradict the others, these
    are named; else the components, with the range of the separate estimates.
    """
    names = [recording.name for recording in recordings if recording.contradicts]
    if names:
        yield (
            f"contradicting the others: {', '.join(names)}. Either the unit has changed between the "
            "recordings, or these recordings are of another unit, or one of their channels is reversed or "
            "not in the described unit: diagnose them alone, and the others without them"
        )
    elif contradicted:
        ranges = []
        for name in contradicted:
            values = [recording.alone[NAMES.index(name)] for recording in recordings]
            ranges.append(f"{name} (alone {min(values):z.4f} to {max(values):z.4f})")
        yield (
            f"the recordings contradict each other in {', '.join(ranges)}: either the unit has changed "
            "between them, for example by wear or a repair, or their conditions differ in a quantity that is "
            "not estimated; diagnose each alone"
        )


HEADER = ("recording", "explained", "residual", "ratio to own fit", "contradicts the others", "nuisances")


@dataclass(frozen=True, eq=False)
class JointDiagnosis(Diagnosis):
    """The faults of one unit that explain all its recordings.

    As `Diagnosis`: the signals of all recordings follow each other, `covariance` and `nuisances` are those of
    the common parameters. `recordings` has the results of each recording; `contradicted` names the faults in
    which recordings differ by more than their errors.
    """

    recordings: tuple[JointRecording, ...] = ()
    contradicted: tuple[str, ...] = ()

    @property
    def contradicting(self) -> tuple[str, ...]:
        """The recordings that contradict the others."""
        return tuple(recording.name for recording in self.recordings if recording.contradicts)

    @property
    def subject(self) -> str:
        """Words for the diagnosed data in sentences."""
        return super().subject if len(self.recordings) == 1 else f"the {len(self.recordings)} recordings"

    def to_dict(self) -> dict[str, Any]:
        """Return the content of `emaphm diagnose --joint --json`, ready for `json.dumps`."""
        return {
            **super().to_dict(),
            "contradicted": list(self.contradicted),
            "recordings": [recording.to_dict() for recording in self.recordings],
        }

    def notes(self) -> list[str]:
        """Return the notes on the table, one line each."""
        lines = super().notes()
        if all(recording.explained for recording in self.recordings):
            lines = [line for line in lines if line != NOT_EXPLAINED]
        return lines

    def __str__(self) -> str:
        """Return the text output of `emaphm diagnose --joint`."""
        rows = [recording.row for recording in self.recordings]
        return f"{super().__str__()}\n\n{format_table(HEADER, rows)}"
