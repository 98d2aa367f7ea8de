"""Draws from a density: proposals, moves, ensembles, evidence, convergence."""
