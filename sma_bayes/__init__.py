"""Bayesian stiffness of shape memory alloy springs."""

__version__ = "0.1.0"
