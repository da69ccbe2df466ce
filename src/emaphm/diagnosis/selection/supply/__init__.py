"""Estimation of a supply voltage that deviates from the description."""
