"""What the numbers of a fit rest on: prior, likelihood, single sweeps and readings."""
