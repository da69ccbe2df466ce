"""A rotor whose electrical zero is not as described contradicts an estimate that has not freed it.

A short of one phase is then read as shorts of others, with a small residual
(`emaphm.diagnosis.selection.rotor_zero`).
"""

from emaphm.arrays import Array
from emaphm.diagnosis.explanation.refits import mean_square_after_descents
from emaphm.diagnosis.selection.rotor_zero import ROTOR_ZERO_SETTINGS, WAY_OUT, with_rotor_at, zero_shown
from emaphm.estimation.search_result import SearchResult
from emaphm.random_streams import stream

DESCENTS = 2
"""With another zero, and without."""


def contradicted_zero(result: SearchResult, jacobians: Array, seed: int) -> tuple[str, ...]:
    """Return why the rotor's zero contradicts the estimate, a sentence; nothing where it does not.

    `jacobians`, (n, d, channel rows), are the estimate's.
    """
    size = zero_shown(result, jacobians)
    if not size:
        return ()
    as_described, elsewhere = (
        mean_square_after_descents(
            result,
            one,
            result.outputs_correction,
            DESCENTS,
            stream(seed, "descents with another zero of the rotor"),
        )
        for one in (result.objective, with_rotor_at(result.objective, size))
    )
    if elsewhere >= ROTOR_ZERO_SETTINGS.share * as_described:
        return ()
    sentence = (
        f"the rotor's electrical zero seems to be {size:+.2g} rad from where the description puts it, "
        "or that and a sixth of a turn; the faults, of one phase or another, would otherwise take it up: "
        f"{WAY_OUT}, or correct the zero of command, position and angle"
    )
    return (sentence,)
