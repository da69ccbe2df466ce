"""Whether an estimate explains a recording, and what is to be doubted all the same."""
