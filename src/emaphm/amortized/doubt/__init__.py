"""Whether an answer is to be doubted: what the averaged model at the answer leaves of the recording."""
