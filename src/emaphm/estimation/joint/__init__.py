"""Joint fit of several recordings: shared and own coordinates, and contradictions between recordings."""
