"""Note on the shared error of all diagnoses of a unit."""

from typing import TYPE_CHECKING

import numpy as np

from emaphm.prognosis.columns import columns_of
from emaphm.quantiles import normal_quantile

if TYPE_CHECKING:
    from emaphm.prognosis.belief import Belief


def shared_error_notes(belief: "Belief", component: str | None) -> list[str]:
    """Return a note if the shared error of the diagnoses is the larger part of a `component`'s error."""
    if component is None:
        return []
    columns = columns_of(component)
    shared = float(np.sqrt(np.diag(belief.shared)[columns].max()))
    own = float(np.sqrt(np.sum(belief.weights * np.einsum("nii->ni", belief.levels), axis=0)[columns].max()))
    if shared <= own:
        return []
    note = (
        f"all diagnoses may have the same error of {normal_quantile(0.975) * shared:.2g} in {component}, "
        "which further diagnoses do not reduce: the unit is known within tolerances only; calibrate it "
        "(emaphm calibrate)"
    )
    return [note]
