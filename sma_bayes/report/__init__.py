"""Figures, tables and the report: every number with its unit."""
