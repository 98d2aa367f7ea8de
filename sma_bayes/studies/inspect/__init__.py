"""What was read of a campaign, before anything is fitted."""
