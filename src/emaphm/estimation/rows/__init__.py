"""Choice of the rows of a recording that are compared, and of means over rows."""
