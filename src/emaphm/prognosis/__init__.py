"""How long a unit will last: requirements, degradation, remaining useful life, metrics, advice."""

from emaphm.prognosis.advice import Advice, Costs
from emaphm.prognosis.evidence import Evidence, Observation
from emaphm.prognosis.fleet_prior import fellows, fleet_prior
from emaphm.prognosis.limits import FailureLevels, failure_levels
from emaphm.prognosis.prior import Prior
from emaphm.prognosis.prognose import Question, prognose
from emaphm.prognosis.requirements import Limit, Requirements
from emaphm.prognosis.result import Prognosis

__all__ = [
    "Advice",
    "Costs",
    "Evidence",
    "FailureLevels",
    "Limit",
    "Observation",
    "Prior",
    "Prognosis",
    "Question",
    "Requirements",
    "failure_levels",
    "fellows",
    "fleet_prior",
    "prognose",
]
