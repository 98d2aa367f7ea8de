"""What the posterior says: bands, correlation, hysteresis, identifiability."""
