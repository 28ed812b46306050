"""Phrases: noun phrases and who is meant by them, and where things are or shall be."""
