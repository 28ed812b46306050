"""Why something waits, runs, or has ended: followed from one reason to the next."""
