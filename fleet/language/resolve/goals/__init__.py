"""What clauses ask for: wishes, commands, what must not be, and what goes on from them."""
