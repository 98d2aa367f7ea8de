"""Figures of moduli."""
