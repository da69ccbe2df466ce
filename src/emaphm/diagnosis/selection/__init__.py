"""Selection of nuisances, sensor errors, laws and parameters that are estimated without a request."""
