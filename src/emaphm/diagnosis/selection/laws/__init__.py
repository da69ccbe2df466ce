"""Laws that the description lacks: fits with them, and which are kept."""
