"""The orders of one robot: the queue, its fencing, the journal, and the way out for reports."""
