"""Task graphs, one for each revision of a plan."""
