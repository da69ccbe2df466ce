"""Study of spoilt recordings of a known actuator: detected, corrected and undetected errors."""
