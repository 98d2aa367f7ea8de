"""The published tables, their errata, the physics that they must obey, and a twin campaign made from them."""
