"""A simulated test rig whose truth is known, and a campaign measured with it."""
