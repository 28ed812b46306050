"""Words: tokens, forms, the grammar's own words, and what the names in a vocabulary stand for."""
