"""Prior of a unit from the other units of its part number."""
