"""All that a study file declares, one verb after the other."""
