"""Posterior of a diagnosis: density, samples by MCMC, and intervals from the samples."""

from emaphm.estimation.posterior.samples import Posterior

__all__ = ["Posterior"]
