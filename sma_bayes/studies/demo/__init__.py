"""The main job on a campaign that ships with the package, without any other file."""
