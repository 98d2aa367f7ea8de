"""Noise models: how observations scatter about the response."""
