"""Test of the rotor's electrical zero at an estimate in which the zero is not free.

With a wrong zero, a short of one phase appears as shorts of other phases, with a small residual
(`emaphm.diagnosis.selection.rotor_zero`).
"""

from emaphm.arrays import Array
from emaphm.diagnosis.explanation.refits import mean_square_after_descents
from emaphm.diagnosis.selection.rotor_zero import ROTOR_ZERO_SETTINGS, WAY_OUT, with_rotor_at, zero_deviation
from emaphm.estimation.search_result import SearchResult
from emaphm.random_streams import stream

DESCENTS = 2
"""Number of descents with the other zero, and with the described one."""


def contradicted_zero(result: SearchResult, jacobians: Array, seed: int) -> tuple[str, ...]:
    """Return a sentence on how the rotor's zero contradicts the estimate; nothing if it does not.

    `jacobians` (n, d, channel rows) are those at the estimate.
    """
    size = zero_deviation(result, jacobians)
    if not size:
        return ()
    as_described, with_other_zero = (
        mean_square_after_descents(
            result,
            objective,
            result.outputs_correction,
            DESCENTS,
            stream(seed, "descents with another zero of the rotor"),
        )
        for objective in (result.objective, with_rotor_at(result.objective, size))
    )
    if with_other_zero >= ROTOR_ZERO_SETTINGS.share * as_described:
        return ()
    sentence = (
        f"the rotor's electrical zero seems to deviate from the description by {size:+.2g} rad, or by that "
        "and a sixth of a turn; otherwise faults of the phases would compensate for it: "
        f"{WAY_OUT}, or correct the zero of command, position and angle"
    )
    return (sentence,)
