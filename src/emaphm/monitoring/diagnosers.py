"""What diagnoses recordings as they arrive: the full search, or an estimator that helps it."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from emaphm.actuator import Actuator
from emaphm.errors import MethodError
from emaphm.estimation.methods import HYBRID
from emaphm.recording import Recording

if TYPE_CHECKING:
    from emaphm.diagnosis import Diagnosis
    from emaphm.fleet import DiagnosisSettings


def load() -> None:
    """Load what diagnoses need, which takes some tenths of a second."""
    import emaphm.diagnosis  # noqa: F401


class Diagnose(Protocol):
    """What diagnoses a recording; `emaphm.diagnose` is one."""

    def __call__(self, recording: Recording, actuator: Actuator, *, seed: int) -> "Diagnosis":
        """Return the diagnosis."""


def search(recording: Recording, actuator: Actuator, *, seed: int) -> "Diagnosis":
    """Return the diagnosis by `emaphm.diagnose`."""
    from emaphm.diagnosis import diagnose

    return diagnose(recording, actuator, seed=seed)


@dataclass(frozen=True)
class ByEstimator:
    """Diagnoses with the help of an estimator that `emaphm train` wrote.

    `fast` says whether its answer is taken as it is (`emaphm.amortized.diagnosing`). A recording that it was
    not trained for, of another manoeuvre say, is diagnosed by the full search; a note says why.
    """

    file: str
    fast: bool = False

    def __call__(self, recording: Recording, actuator: Actuator, *, seed: int) -> "Diagnosis":
        """Return the diagnosis."""
        try:
            return self.settings(seed).diagnosed(recording, actuator)
        except MethodError as error:
            from emaphm.amortized.applicability.refusals import LEAVE_OUT

            note = f"the estimator was not asked: {str(error).partition(f'; {LEAVE_OUT}')[0]}"
            return search(recording.with_channels(recording.channels, [note]), actuator, seed=seed)

    def check(self, actuator: Actuator) -> None:
        """Refuse a file that is no estimator of this actuator, `MethodError`."""
        from emaphm.fleet.settings import estimator_at

        self.settings(0).check_estimator()
        estimator_at(self.file).check_trained_for(actuator)

    def settings(self, seed: int) -> "DiagnosisSettings":
        """Return what it asks of `emaphm.fleet`."""
        from emaphm.fleet import DiagnosisSettings

        return DiagnosisSettings(seed=seed, estimator=self.file, fast=self.fast)


def refusal_of(diagnose: Diagnose, actuator: Actuator) -> str:
    """Return why the estimator of `diagnose` cannot be used now; empty where it can, or there is none."""
    if not isinstance(diagnose, ByEstimator):
        return ""
    try:
        diagnose.check(actuator)
    except MethodError as error:
        return str(error)
    return ""


def methods_of(diagnose: Diagnose) -> tuple[str, ...]:
    """Return what the method of its diagnoses may be called."""
    return diagnose.settings(0).method_names if isinstance(diagnose, ByEstimator) else (HYBRID,)
