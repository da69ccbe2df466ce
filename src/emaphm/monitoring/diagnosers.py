"""Methods of diagnosis in online monitoring: the full search, or a trained estimator."""

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
    """Import the modules that diagnoses need, which takes a few tenths of a second."""
    import emaphm.diagnosis  # noqa: F401


class Diagnose(Protocol):
    """Interface of a method that diagnoses a recording, such as `emaphm.diagnose`."""

    def __call__(self, recording: Recording, actuator: Actuator, *, seed: int) -> "Diagnosis":
        """Return the diagnosis."""


def search(recording: Recording, actuator: Actuator, *, seed: int) -> "Diagnosis":
    """Return the diagnosis by `emaphm.diagnose`."""
    from emaphm.diagnosis import diagnose

    return diagnose(recording, actuator, seed=seed)


@dataclass(frozen=True)
class ByEstimator:
    """Diagnosis with an estimator from a `file` that `emaphm train` wrote.

    With `fast`, its answer is accepted without a search (`emaphm.amortized.diagnosing`). A recording for
    which it was not trained, for example of another manoeuvre, is diagnosed by the full search, with a note
    on the reason.
    """

    file: str
    fast: bool = False

    def __call__(self, recording: Recording, actuator: Actuator, *, seed: int) -> "Diagnosis":
        """Return the diagnosis."""
        try:
            return self.settings(seed).diagnosed(recording, actuator)
        except MethodError as error:
            from emaphm.amortized.applicability.refusals import LEAVE_OUT

            note = f"the estimator was not used: {str(error).partition(f'; {LEAVE_OUT}')[0]}"
            return search(recording.with_channels(recording.channels, [note]), actuator, seed=seed)

    def check(self, actuator: Actuator) -> None:
        """Raise `MethodError` for a file that is no estimator of this actuator."""
        from emaphm.fleet.settings import estimator_at

        self.settings(0).check_estimator()
        estimator_at(self.file).check_trained_for(actuator)

    def settings(self, seed: int) -> "DiagnosisSettings":
        """Return the settings of the diagnosis for `emaphm.fleet`."""
        from emaphm.fleet import DiagnosisSettings

        return DiagnosisSettings(seed=seed, estimator=self.file, fast=self.fast)


def refusal_of(diagnose: Diagnose, actuator: Actuator) -> str:
    """Return the reason why the estimator of `diagnose` cannot be used now, empty if there is no reason."""
    if not isinstance(diagnose, ByEstimator):
        return ""
    try:
        diagnose.check(actuator)
    except MethodError as error:
        return str(error)
    return ""


def methods_of(diagnose: Diagnose) -> tuple[str, ...]:
    """Return the possible names of the method in its diagnoses."""
    return diagnose.settings(0).method_names if isinstance(diagnose, ByEstimator) else (HYBRID,)
