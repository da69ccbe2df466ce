"""Notes on what makes a forecast of a unit worth less than it looks."""
