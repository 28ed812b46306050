"""What is over: the archive of it, what it comes to, and when its keys are deleted."""
