"""Reference, monitor and averaged models of the actuator."""
