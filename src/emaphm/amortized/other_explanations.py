"""Whether faults that an answer alone names may be something else: a delay, or a law nobody described.

Asked where no search follows, and where a component is called degraded: a search asks for both itself.
"""

from dataclasses import replace

from emaphm.arrays import Array
from emaphm.diagnosis.explanation.alternatives import beyond_a_delay
from emaphm.diagnosis.selection.hidden_laws import suspected_laws
from emaphm.diagnosis.verdict import Estimate, estimates
from emaphm.estimation.bias_correction import with_discrepancy
from emaphm.estimation.search_result import SearchResult
from emaphm.estimation.uncertainty.local_covariance import jacobians_at
from emaphm.random_streams import stream


def other_explanations(result: SearchResult, covariance: Array, seed: int) -> tuple[str, ...]:
    """Return what else may be the faults of an answer, a clause each; nothing where it calls none degraded.

    `result` is the averaged model at the answer's mean, whose `covariance` is (d, d).
    """
    components = estimates(result.objective.space, result.point, covariance)
    if all(one.verdict != "degraded" for one in components.values()):
        return ()
    weighted = result.reweighted()
    jacobians = jacobians_at(weighted.objective, result.point, stream(seed, "Jacobians at the answer"))
    delay = _delay(components["gain"], weighted, jacobians)
    return delay or _laws(replace(weighted, jacobians=jacobians), seed)


def _delay(gain: Estimate, result: SearchResult, jacobians: Array) -> tuple[str, ...]:
    """Return why the gain may be a delay; nothing where it is none.

    The residual at the answer shows no delay of a row where the actuator is nearly healthy. The search, which
    has the reference model, knows the gain better, and says what it cannot exclude.
    """
    if gain.verdict != "degraded":
        return ()
    checked = beyond_a_delay(gain, result, jacobians)
    return () if checked.verdict == "degraded" else (f"its gain may be a delay: {checked.reason}",)


def _laws(result: SearchResult, seed: int) -> tuple[str, ...]:
    """Return which laws the residual shows once the reference model has corrected it, a clause."""
    names = suspected_laws(with_discrepancy(result, seed), seed)
    if not names:
        return ()
    laws = " or ".join(f"'{name}'" for name in names)
    return (f"its faults may be a law that the actuator's description lacks: {laws}",)
