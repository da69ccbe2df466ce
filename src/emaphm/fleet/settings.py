"""Settings of the diagnoses of a batch."""

from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Self

from emaphm.actuator import Actuator
from emaphm.amortized.diagnosing import CORRECTED, diagnose_by
from emaphm.amortized.estimator import Estimator
from emaphm.diagnosis import Diagnosis, diagnose
from emaphm.diagnosis.result import ESTIMATOR
from emaphm.errors import MethodError
from emaphm.estimation.bias_correction import MAX_CORRECTIONS
from emaphm.estimation.methods import HYBRID, method_named
from emaphm.estimation.search import check_fitness
from emaphm.estimation.space.nuisances import NuisanceSet
from emaphm.input_files import content_digest
from emaphm.progress import Progress
from emaphm.random_streams import check_seed
from emaphm.recording import Recording
from emaphm.simulation import model_named


@dataclass(frozen=True)
class DiagnosisSettings:
    """The arguments of `emaphm.diagnose` with these names, the same for all recordings.

    `estimator` is the file of an estimator, and `fast` is True if its answer is used without the full search
    (`emaphm.amortized.diagnosing`). `estimator_digest` is the required SHA-256 of this file, or None.
    """

    method: str = "hybrid"
    model: str = "averaged"
    fitness: str = "least_squares"
    max_corrections: int = MAX_CORRECTIONS
    nuisances: tuple[str, ...] | None = None
    posterior: bool = False
    estimator: str | None = None
    fast: bool = False
    seed: int = 0
    estimator_digest: str | None = None

    def __post_init__(self) -> None:
        """Refuse a negative seed; `SignalError`."""
        check_seed(self.seed)

    def check(self, actuator: Actuator) -> None:
        """Refuse settings with which no recording can be diagnosed, `MethodError`."""
        check_fitness(method_named(self.method), self.fitness)
        model_named(self.model)
        NuisanceSet.of(actuator, self.nuisances, ())
        self.check_estimator()

    def check_estimator(self) -> None:
        """Refuse an estimator that cannot be read, or that contradicts the other settings."""
        if self.estimator is None:
            if self.fast:
                raise MethodError("a fast answer needs an estimator; give its file")
            return
        for name, required in (("method", HYBRID), ("model", "averaged")):
            if getattr(self, name) != required:
                raise MethodError(
                    f"an estimator needs {name} '{required}'; leave out {name} '{getattr(self, name)}', or "
                    "the estimator"
                )
        if self.fast and self.nuisances is not None:
            raise MethodError(
                "an estimator's answer has the nuisances of its training; leave out the nuisances, or --fast"
            )
        estimator_at(self.estimator, self.estimator_digest)

    def pinned(self) -> Self:
        """Return the settings with the digest of their estimator, so that a replaced file is refused."""
        if self.estimator is None or self.estimator_digest is not None:
            return self
        return replace(self, estimator_digest=content_digest(Path(self.estimator)))

    @property
    def method_names(self) -> tuple[str, ...]:
        """Possible names of the method of a diagnosis: the given one, or the full search as a fallback."""
        if self.estimator is None:
            return (self.method,)
        return (ESTIMATOR, CORRECTED, HYBRID) if self.fast else (CORRECTED, HYBRID)

    def diagnosed(
        self,
        recording: Recording,
        actuator: Actuator,
        *,
        workers: int | None = 1,
        on_progress: Progress | None = None,
    ) -> Diagnosis:
        """Return the diagnosis of one recording.

        The default is one thread, because a batch diagnoses several recordings in parallel.
        """
        if self.estimator is None:
            values = asdict(self)
            for name in ("estimator", "fast", "estimator_digest"):
                del values[name]
            return diagnose(recording, actuator, **values, workers=workers, on_progress=on_progress)
        self.check_estimator()
        return diagnose_by(
            estimator_at(self.estimator, self.estimator_digest),
            recording,
            actuator,
            fast=self.fast,
            max_corrections=self.max_corrections,
            nuisances=self.nuisances,
            posterior=self.posterior,
            seed=self.seed,
            workers=workers,
            on_progress=on_progress,
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the settings, ready for `json.dumps`; an estimator by the digest of its file."""
        values = asdict(self.pinned())
        values["estimator"] = values.pop("estimator_digest")
        return values


def estimator_at(path: str | Path, digest: str | None = None) -> Estimator:
    """Return the estimator in a file, read once per process as long as the file does not change.

    Raises
    ------
    MethodError
        The file cannot be read, or its SHA-256 is not `digest`.
    """
    resolved = Path(path)
    try:
        status = resolved.stat()
    except (OSError, ValueError):
        return Estimator.load(resolved)  # raises the error
    of_file = resolved.absolute(), status.st_mtime_ns, status.st_size
    if digest is None:
        return _read(*of_file)
    estimator, actual_digest = _read_with_digest(*of_file)
    if actual_digest != digest:
        raise MethodError(
            f"{path}: has changed since the work began; put the same file there and start again"
        )
    return estimator


@lru_cache(maxsize=4)
def _read(path: Path, _changed: int, _size: int) -> Estimator:
    return Estimator.load(path)


@lru_cache(maxsize=4)
def _read_with_digest(path: Path, _changed: int, _size: int) -> tuple[Estimator, str]:
    """Return the estimator and the digest of its file, empty if the file was replaced while reading."""
    before = content_digest(path)
    estimator = Estimator.load(path)
    return estimator, before if content_digest(path) == before else ""
