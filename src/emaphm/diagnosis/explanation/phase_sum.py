"""Check that the three phase currents of a star add up to zero."""

from collections.abc import Iterator

import numpy as np

from emaphm.arrays import rms
from emaphm.diagnosis.explanation.residuals import percent
from emaphm.diagnosis.explanation.settings import EXPLANATION
from emaphm.estimation.search_result import SearchResult
from emaphm.recording.noise import robust_noise_level, rounding_step
from emaphm.recording.schema import PHASES


def phase_sum(result: SearchResult) -> Iterator[str]:
    """Yield a sentence on the sum of the recorded phase currents and its cause, if it is not zero."""
    measured = result.objective.problem.measured
    if not all(name in measured for name in PHASES):
        return
    phases = np.stack([measured[name] for name in PHASES])
    level = rms(phases)
    total = phases.sum(axis=0)
    imbalance, noise = rms(total), max(robust_noise_level(total, 2), rounding_step(total) / 12**0.5)
    allowed = EXPLANATION.phase_sum * level + EXPLANATION.channel_noise * noise
    if imbalance <= allowed:
        return
    constant = float(total.mean())
    variation = rms(total - constant)
    if variation <= min(allowed, abs(constant)):
        yield (
            f"the phase currents add up to a constant {constant:+.3g} A, and not to 0: a zero error of one "
            "of the phases (the sum does not identify which); check each sensor without current"
        )
    else:
        yield (
            f"the phase currents add up to {percent(imbalance, level)} of their rms, and not to 0; the scale "
            "of one of them or its sign is wrong, or one is missing"
        )
