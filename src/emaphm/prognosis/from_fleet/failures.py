"""Failure times of other units, which had their own requirements, for the present limits."""

from typing import TYPE_CHECKING

import numpy as np

from emaphm.prognosis.columns import columns_of, level_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from emaphm.prognosis.evidence import Observation
    from emaphm.prognosis.requirements.margins import Limit

SIGNIFICANT = 3.0
"""Standard errors by which a last level must be beyond a limit: such a unit had a wider limit."""


def passed_at(life: "Sequence[Observation]", limits: "Sequence[Limit]") -> float:
    """Return the first hours [h] at which a component was beyond one of the `limits`, or `inf`.

    Only limits on components are used, if the last diagnosis of the `life` is significantly beyond them.
    Because diagnoses have errors and wear does not heal, margins are replaced by the nearest decreasing
    sequence (isotonic regression), interpolated linearly between diagnoses.
    """
    from scipy.optimize import isotonic_regression

    passages = [np.inf]
    for limit in limits:
        columns = columns_of(str(limit.component))
        diagnoses = [diagnosis for diagnosis in life if diagnosis.seen[columns].all()]
        if not diagnoses:
            continue
        level = np.array([diagnosis.level for diagnosis in diagnoses])
        margin = limit.margin(level_of(level, str(limit.component)))
        error = np.sqrt(np.diag(diagnoses[-1].covariance)[columns].max())
        if margin[-1] < -SIGNIFICANT * error:
            hours = [diagnosis.hours for diagnosis in diagnoses]
            passages.append(float(np.interp(0.0, isotonic_regression(-margin).x, hours)))
    return min(passages)
