"""A small certificate authority for a fleet: who is who on its network."""
