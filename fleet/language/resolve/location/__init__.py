"""Where phrases of place point."""
