"""Who and what noun phrases mean: names, pronouns, lists, states, owners and parts."""
