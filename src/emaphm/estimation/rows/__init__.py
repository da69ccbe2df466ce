"""Which rows of a recording are compared, and in what means."""
