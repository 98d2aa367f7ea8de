"""What a verb found, told to people at a terminal: a file for each verb."""
