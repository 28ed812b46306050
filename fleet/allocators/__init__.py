"""Allocators: one file or package a variant."""
