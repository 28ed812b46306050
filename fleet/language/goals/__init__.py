"""Goals: clauses that ask for something, to stages of conditions."""
