"""What words can stand for: tags over words and names, by the words of the language and the world."""
