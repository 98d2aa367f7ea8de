"""What a temperature gives, or which temperatures give a wanted value."""
