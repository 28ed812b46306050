"""A simulated world served over keys: motion calls in; clock, senses, truth and frames out."""
