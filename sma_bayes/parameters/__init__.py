"""Parameters, their priors and the coordinates in which they are sampled."""
