"""Settings of all tests."""

from hypothesis import settings

# Examples are the same on every run, as everything else here; kernels compile on their first call.
settings.register_profile("emaphm", deadline=None, derandomize=True, max_examples=60)
settings.load_profile("emaphm")
