"""All figures, and the one door to matplotlib and corner: drawn without pyplot, saved with their data."""
