"""The contract of the fleet: every key, its payload, who writes it, who reads it."""
