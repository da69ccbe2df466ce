"""The result of a joint diagnosis: the faults of one unit, and what each of its recordings says of them."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

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
        Of the file.
    channels
        What was compared.
    explained
        Whether its residual under the common faults is no more than noise and model account for.
    residual_rms_A, relative_residual
        Of recorded less modelled current [A], and as a fraction of the recorded current's rms.
    misfit_ratio
        Its rms residual under the common faults over that of its own best fit.
    contradicts
        Whether the faults that it alone asks for contradict those of the others.
    alone
        The faults (8,) that it alone asks for.
    nuisances
        What was estimated of this recording.
    load
        The load over the recording, where it is estimated as one that varies.
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
            "nuisances": {name: one.to_dict() for name, one in self.nuisances.items()},
        }

    @property
    def row(self) -> tuple[str, ...]:
        """The recording's row of text."""
        varying = [f"load {self.load}"] if self.load else []
        others = [
            f"{name} {one}"
            for name, one in self.nuisances.items()
            if one.known and not (self.load and is_of_load(name))
        ]
        return (
            self.name,
            "yes" if self.explained else "no",
            f"{100 * self.relative_residual:.1f} %",
            f"{self.misfit_ratio:.2f}",
            "yes" if self.contradicts else "no",
            ", ".join([*varying, *others]),
        )


HEADER = ("recording", "explained", "residual", "of its own fit's", "contradicts the others", "nuisances")


@dataclass(frozen=True, eq=False)
class JointDiagnosis(Diagnosis):
    """The faults of one unit that explain all its recordings.

    As `Diagnosis`: signals are those of the recordings end to end, `covariance` and `nuisances` those of what
    the recordings share. `recordings` has what is each one's own; `contradicted` names the faults in which
    they differ by more than their errors.
    """

    recordings: tuple[JointRecording, ...] = ()
    contradicted: tuple[str, ...] = ()

    @property
    def contradicting(self) -> tuple[str, ...]:
        """The recordings that contradict the others."""
        return tuple(one.name for one in self.recordings if one.contradicts)

    @property
    def subject(self) -> str:
        """What was diagnosed, in words."""
        return f"the {len(self.recordings)} recordings"

    def to_dict(self) -> dict[str, Any]:
        """Return what `emaphm diagnose --joint --json` prints, ready for `json.dumps`."""
        return {
            **super().to_dict(),
            "contradicted": list(self.contradicted),
            "recordings": [one.to_dict() for one in self.recordings],
        }

    def notes(self) -> list[str]:
        """Return what a reader must know with the table, a line each."""
        lines = super().notes()
        if all(one.explained for one in self.recordings):
            lines = [line for line in lines if line != NOT_EXPLAINED]
        if self.contradicting:
            lines.append(
                f"Contradicting the others: {', '.join(self.contradicting)}. Either the unit has changed "
                "between the recordings, or these are of another unit, or a channel of theirs is reversed or "
                "not in the unit described: diagnose them alone, and the others without them."
            )
        elif self.contradicted:
            lines.append(
                f"The recordings contradict each other in {', '.join(self.contradicted)}: diagnose each "
                "alone."
            )
        return lines

    def __str__(self) -> str:
        """Return what `emaphm diagnose --joint` prints."""
        rows = [one.row for one in self.recordings]
        return f"{super().__str__()}\n\n{format_table(HEADER, rows)}"
