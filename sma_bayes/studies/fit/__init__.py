"""Fit every record of a campaign: posterior, bands, correlation, report."""
