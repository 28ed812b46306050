"""A world without physics."""
