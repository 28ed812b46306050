"""The processes of a fleet on this machine: started, watched, told of, and ended."""
