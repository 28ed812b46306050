"""How many robots arrive where they are sent, by how many there are."""
