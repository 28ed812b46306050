"""Texts cut into sentences, and these into the parts that are parsed by themselves."""
