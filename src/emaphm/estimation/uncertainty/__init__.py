"""How well an estimate is known: information, covariance, and what is identifiable only in combination."""
