"""Tasks that people name, as data: phrases, and the methods by which they are decomposed."""
