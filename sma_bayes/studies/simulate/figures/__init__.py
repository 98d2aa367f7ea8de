"""Figures of a simulation."""
