"""The main job on a twin of the published campaign, without any file."""
