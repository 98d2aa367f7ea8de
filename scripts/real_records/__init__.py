"""Fits of real measurements beside what a user would take instead: what is left, what is predicted, and how surely."""
