"""What the package shows of itself before anything of it is imported."""

import emaphm


def test_every_public_name_is_listed_and_can_be_imported() -> None:
    assert set(emaphm.__all__) <= set(dir(emaphm))
    assert all(getattr(emaphm, name) is not None for name in emaphm.__all__)
