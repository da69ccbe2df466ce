"""The prior of a new unit from the other units of its part number."""
