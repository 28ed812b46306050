"""World, robot and mission files: their types, how they are read, and what is checked."""
