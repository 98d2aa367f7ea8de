"""What operating conditions do to the curve, and what it would be under conditions that were not measured."""
