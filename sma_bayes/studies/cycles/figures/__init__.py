"""Figures of a study of cycles."""
