"""What the commands read from, write to and ask of the key-space."""
