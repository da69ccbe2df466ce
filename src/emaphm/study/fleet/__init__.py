"""Study of predictions of remaining useful life on a synthetic fleet, against truth and other methods."""
