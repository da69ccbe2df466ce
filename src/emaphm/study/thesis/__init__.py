"""Published results of the thesis, and repetitions of its studies."""
