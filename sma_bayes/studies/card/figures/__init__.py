"""Figures of a card."""
