"""Cycle by cycle: the numbers of every sweep, the law of training, when a spring is stable, and later cycles."""
