"""How good an estimator trained on simulations is, and how many recordings it answers in a second."""
