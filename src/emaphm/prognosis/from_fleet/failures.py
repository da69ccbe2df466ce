"""What failures of other units, by the requirements that they had, say of limits that are asked now."""

from typing import TYPE_CHECKING

import numpy as np

from emaphm.prognosis.columns import columns_of, level_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from emaphm.prognosis.evidence import Observation
    from emaphm.prognosis.requirements.margins import Limit

SIGNIFICANT = 3.0
"""Standard errors by which a level is beyond a limit: a unit that failed there had a wider one."""


def passed_at(life: "Sequence[Observation]", limits: "Sequence[Limit]") -> float:
    """Return the hours [h] at which a component was first beyond one of the `limits`; `inf` where none was.

    Of the limits of components alone that the last diagnosis of a `life` is significantly beyond. Diagnoses
    err, wear does not heal: margins are replaced by the falling sequence nearest to them, straight between
    diagnoses.
    """
    from scipy.optimize import isotonic_regression

    passages = [np.inf]
    for limit in limits:
        columns = columns_of(str(limit.component))
        seen = [one for one in life if one.seen[columns].all()]
        if not seen:
            continue
        level = np.array([one.level for one in seen])
        margin = limit.margin(level_of(level, str(limit.component)))
        error = np.sqrt(np.diag(seen[-1].covariance)[columns].max())
        if margin[-1] < -SIGNIFICANT * error:
            hours = [one.hours for one in seen]
            passages.append(float(np.interp(0.0, isotonic_regression(-margin).x, hours)))
    return min(passages)
