"""Requirements of an actuator: their margins for given faults, and the fault levels at which they fail."""

from emaphm.prognosis.requirements.levels import FailureLevels, failure_levels
from emaphm.prognosis.requirements.margins import Limit, Requirements, vectors_of

__all__ = ["FailureLevels", "Limit", "Requirements", "failure_levels", "vectors_of"]
