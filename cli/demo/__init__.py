"""`robotctl demo`: a whole mission as separate processes, judged by the physics."""
