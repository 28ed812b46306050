"""The household skills: one file each; `household.py` lists them."""
