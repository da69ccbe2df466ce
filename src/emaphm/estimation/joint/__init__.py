"""One fit of several recordings: what they share, what is their own, and where they contradict each other."""
