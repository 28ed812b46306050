"""From trees to goals, facts and questions: who and what is meant, in this world."""
