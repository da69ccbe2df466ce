"""What a calibration leaves open, or what makes it worthless: motion one way, a wrong sign, a missing law."""
