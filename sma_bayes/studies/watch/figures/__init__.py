"""Figures of a watch."""
