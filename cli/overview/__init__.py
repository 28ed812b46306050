"""The fleet on one page: what needs a person, what runs, what waits, and what is over."""
