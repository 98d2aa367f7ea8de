"""What a fit is, and how it is stored."""
