"""What people ask of robots, and how much of it is understood."""
