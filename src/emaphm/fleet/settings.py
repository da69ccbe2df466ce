"""How each recording of a batch is diagnosed."""

from dataclasses import asdict, dataclass
from typing import Any

from emaphm.actuator import Actuator
from emaphm.diagnosis import Diagnosis, diagnose
from emaphm.estimation.bias_correction import MAX_CORRECTIONS
from emaphm.estimation.methods import method_named
from emaphm.estimation.nuisances import NuisanceSet
from emaphm.estimation.search import check_fitness
from emaphm.recording import Recording
from emaphm.simulation import model_named


@dataclass(frozen=True)
class DiagnosisSettings:
    """The arguments of `emaphm.diagnose` by these names, the same for every recording."""

    method: str = "hybrid"
    model: str = "averaged"
    fitness: str = "least_squares"
    max_corrections: int = MAX_CORRECTIONS
    nuisances: tuple[str, ...] | None = None
    posterior: bool = False
    seed: int = 0

    def check(self, actuator: Actuator) -> None:
        """Refuse what no recording could be diagnosed by; `MethodError` says why."""
        check_fitness(method_named(self.method), self.fitness)
        model_named(self.model)
        NuisanceSet.of(actuator, self.nuisances, ())

    def diagnosed(self, recording: Recording, actuator: Actuator) -> Diagnosis:
        """Return the diagnosis of one recording, on one thread: a batch keeps the cores busy side by side."""
        return diagnose(recording, actuator, **asdict(self), workers=1)

    def to_dict(self) -> dict[str, Any]:
        """Return the settings, ready for `json.dumps`."""
        return asdict(self)
