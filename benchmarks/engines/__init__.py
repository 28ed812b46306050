"""Classical planners beside our own search, on the same household problems."""
