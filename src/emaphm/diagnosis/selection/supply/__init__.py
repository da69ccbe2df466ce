"""The supply: what the recording shows of its voltage, and the estimate with another."""
