"""The published tables, and a twin campaign made from them."""
