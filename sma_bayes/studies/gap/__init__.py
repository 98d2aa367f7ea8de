"""Where model and measurement disagree, what is missing, and how much adding it closes the gap."""
