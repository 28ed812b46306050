"""Public sets of tasks, run from a copy of your own; nothing of them is in this repository."""
