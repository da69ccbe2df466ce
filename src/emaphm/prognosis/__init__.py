"""Prognosis of a unit: requirements, degradation, remaining useful life, metrics, advice."""

from emaphm.prognosis.advice import Advice, Costs
from emaphm.prognosis.evidence import Evidence, Observation
from emaphm.prognosis.from_fleet.fleet import fleet_prior, learnt_prior
from emaphm.prognosis.prior import Prior
from emaphm.prognosis.prognose import Question, prognose
from emaphm.prognosis.requirements import FailureLevels, Limit, Requirements, failure_levels
from emaphm.prognosis.result import Prognosis
from emaphm.prognosis.stress import Stress, StressPiece, StressReference

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
    "Stress",
    "StressPiece",
    "StressReference",
    "failure_levels",
    "fleet_prior",
    "learnt_prior",
    "prognose",
]
