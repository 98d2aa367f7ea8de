"""Records, response, noise and priors as one density: its start, its choice of noise and model, its draws."""
