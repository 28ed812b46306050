"""What words can stand for: tags over words and names, by the language and the world."""
