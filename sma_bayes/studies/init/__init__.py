"""A campaign file for a folder of data files."""
