"""Laws that the description lacks: fits with them, and their selection."""
