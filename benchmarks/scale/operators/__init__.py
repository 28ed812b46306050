"""People who do things to a fleet while it works, by chance, and who looks what becomes of it."""
