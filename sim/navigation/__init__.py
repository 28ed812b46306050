"""How robots find their way and keep out of each other's. Pure: numpy and scipy only."""
