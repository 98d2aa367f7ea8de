"""What the program can be asked to do: a folder for each verb."""
