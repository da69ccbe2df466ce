"""The posterior of a diagnosis: its density, samples of it by MCMC, and intervals from the samples."""

from emaphm.estimation.posterior.mcmc import check_posterior, sample
from emaphm.estimation.posterior.samples import Posterior

__all__ = ["Posterior", "check_posterior", "sample"]
