"""Allocators: one file a variant."""
