"""Figures of a study of sensitivity."""
