"""Study of estimators trained on simulations: accuracy, and number of recordings answered per second."""
