"""What a run has on disk, how it is read again, resumed and shared among processes."""
