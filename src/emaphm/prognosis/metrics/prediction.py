"""A predicted remaining useful life, as a sample."""

from dataclasses import dataclass

import numpy as np

from emaphm.arrays import Array
from emaphm.errors import PrognosisError
from emaphm.quantiles import sample_quantile


@dataclass(frozen=True, eq=False)
class Prediction:
    """A predicted RUL at flight `hours` [h]: an equally weighted sample [h], shape (n,), n ≥ 1.

    Raises
    ------
    PrognosisError
        The sample is empty, or a value is negative or not a number.
    """

    hours: float
    sample: Array

    def __post_init__(self) -> None:
        sample = np.sort(np.asarray(self.sample, float).ravel())
        if not sample.size or not sample[0] >= 0 or np.isnan(sample[-1]):
            raise PrognosisError(
                f"the prediction at {self.hours:.9g} h needs a sample of RUL values of 0 or more, got "
                f"{sample.size} values"
            )
        object.__setattr__(self, "sample", sample)

    @property
    def median(self) -> float:
        """Median of the RUL [h]; `inf` if no failure is in sight."""
        return self.quantile(0.5)

    def quantile(self, probability: float) -> float:
        """Return the quantile of the RUL [h]: the smallest value not below that share of the sample."""
        return sample_quantile(self.sample, probability)

    def share_within(self, low: float, high: float) -> float:
        """Return the probability that low ≤ RUL ≤ high [h]."""
        last = np.searchsorted(self.sample, high, "right")
        return float(last - np.searchsorted(self.sample, low, "left")) / self.sample.size
