"""Measurements: what a record is, and how files become records."""

from sma_bayes.records.types import Branch, Calibration, Campaign, Condition, Finding, HeldChannel, Record

__all__ = ["Branch", "Calibration", "Campaign", "Condition", "Finding", "HeldChannel", "Record"]
