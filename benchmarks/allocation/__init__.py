"""Benchmarks of allocation and scheduling."""
