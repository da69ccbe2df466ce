"""A note on the error that all diagnoses of a unit have in common."""

from typing import TYPE_CHECKING

import numpy as np

from emaphm.prognosis.columns import columns_of
from emaphm.quantiles import normal_quantile

if TYPE_CHECKING:
    from emaphm.prognosis.belief import Belief


def shared_error_notes(belief: "Belief", component: str | None) -> list[str]:
    """Return a note where the error that all diagnoses share is most of the error of a `component`."""
    if component is None:
        return []
    columns = columns_of(component)
    shared = float(np.sqrt(np.diag(belief.shared)[columns].max()))
    own = float(np.sqrt(np.sum(belief.weights * np.einsum("nii->ni", belief.levels), axis=0)[columns].max()))
    if shared <= own:
        return []
    note = (
        f"all diagnoses may be off by the same {normal_quantile(0.975) * shared:.2g} of {component}, which "
        "further ones do not reduce: the unit is known to tolerances only; calibrate it (emaphm calibrate)"
    )
    return [note]
