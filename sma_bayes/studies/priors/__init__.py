"""Priors as TOML, to look at and to edit."""
