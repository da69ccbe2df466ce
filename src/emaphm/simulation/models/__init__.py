"""The reference, monitor and averaged models of the actuator."""
