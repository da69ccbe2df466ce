"""Three phase currents of a star, which add up to zero."""

from collections.abc import Iterator

import numpy as np

from emaphm.arrays import rms
from emaphm.diagnosis.explanation.residuals import percent
from emaphm.diagnosis.explanation.settings import EXPLANATION
from emaphm.estimation.search_result import SearchResult
from emaphm.recording.noise import robust_noise_level, rounding_step
from emaphm.recording.schema import PHASES


def phase_sum(result: SearchResult) -> Iterator[str]:
    """Yield by how much the recorded phase currents do not add up to zero, and what that may be."""
    measured = result.objective.problem.measured
    if not all(name in measured for name in PHASES):
        return
    phases = np.stack([measured[name] for name in PHASES])
    size = rms(phases)
    total = phases.sum(axis=0)
    imbalance, noise = rms(total), max(robust_noise_level(total, 2), rounding_step(total) / 12**0.5)
    allowed = EXPLANATION.phase_sum * size + EXPLANATION.channel_noise * noise
    if imbalance <= allowed:
        return
    constant = float(total.mean())
    rest = rms(total - constant)
    if rest <= min(allowed, abs(constant)):
        yield (
            f"the phase currents add up to a constant {constant:+.3g} A, and not to 0: a zero error of one "
            "of the phases, the sum does not show of which; check each sensor without current"
        )
    else:
        yield (
            f"the phase currents add up to {percent(imbalance, size)} of their rms, and not to 0; the scale "
            "of one of them or its sign is wrong, or one is missing"
        )
