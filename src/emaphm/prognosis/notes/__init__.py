"""Notes on limitations of the forecast of a unit."""
