"""Both ends of the store behind a router: what it is asked and told, and by whom."""
