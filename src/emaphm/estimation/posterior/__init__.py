"""The posterior of a diagnosis: its density, samples of it by MCMC, and intervals from the samples."""

from emaphm.estimation.posterior.samples import Posterior

__all__ = ["Posterior"]
