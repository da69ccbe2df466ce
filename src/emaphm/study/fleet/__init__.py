"""How good predictions of remaining useful life are on a synthetic fleet, against truth and other ways."""
