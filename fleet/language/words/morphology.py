"""Forms of English words: plurals of nouns, and the forms of verbs that sentences use."""

from __future__ import annotations

_IRREGULAR_PLURALS = {
    "person": "people",
    "man": "men",
    "woman": "women",
    "child": "children",
    "mouse": "mice",
    "foot": "feet",
    "tooth": "teeth",
}
_IRREGULAR_PARTICIPLES = {
    "bring": ("brought",),
    "take": ("taken", "took"),
    "get": ("gotten", "got"),
    "put": ("put",),
    "set": ("set",),
    "lay": ("laid",),
    "leave": ("left",),
    "send": ("sent",),
    "drive": ("driven", "drove"),
    "give": ("given", "gave"),
    "find": ("found",),
    "seek": ("sought",),
    "hold": ("held",),
    "go": ("gone", "went"),
    "come": ("come", "came"),
    "see": ("seen",),
    "cut": ("cut",),
    "shut": ("shut",),
    "hide": ("hidden",),
    "make": ("made",),
    "do": ("done", "did"),
    "sweep": ("swept",),
    "hang": ("hung",),
    "keep": ("kept",),
    "throw": ("thrown", "threw"),
    "draw": ("drawn", "drew"),
    "feed": ("fed",),
    "light": ("lit",),
    "stick": ("stuck",),
    "slide": ("slid",),
    "stand": ("stood",),
    "write": ("written", "wrote"),
    "read": ("read",),
    "buy": ("bought",),
    "tell": ("told",),
    "say": ("said",),
    "run": ("run",),
}
_DOUBLED = frozenset({"transfer"})
_VOWELS = frozenset("aeiou")
_UNDOUBLED = frozenset("wxy")


def _doubles(verb: str) -> bool:
    """Whether its last letter is written twice before an ending: `mop`, `plug`, but not `clean`."""
    short = len(verb) > 2 and sum(letter in _VOWELS for letter in verb) == 1
    last = verb[-1:] not in _VOWELS | _UNDOUBLED and verb[-2:-1] in _VOWELS
    return verb in _DOUBLED or (short and last)


def plurals(noun: str) -> frozenset[str]:
    """The plural forms of a noun: usually one, two where spelling varies."""
    if noun in _IRREGULAR_PLURALS:
        return frozenset({_IRREGULAR_PLURALS[noun]})
    forms = {f"{noun}s"}
    if noun.endswith(("s", "x", "z", "ch", "sh", "o")):
        forms = {f"{noun}es"} | ({f"{noun}s"} if noun.endswith("o") else set())
    elif noun.endswith("y") and noun[-2:-1] not in _VOWELS:
        forms = {f"{noun[:-1]}ies"}
    elif noun.endswith("fe"):
        forms |= {f"{noun[:-2]}ves"}
    elif noun.endswith("f"):
        forms |= {f"{noun[:-1]}ves"}
    return frozenset(forms)


def gerund(verb: str) -> str:
    """`bring` → `bringing`, `move` → `moving`, `put` → `putting`."""
    if _doubles(verb):
        return f"{verb}{verb[-1]}ing"
    return f"{verb[:-1]}ing" if verb.endswith("e") and not verb.endswith("ee") else f"{verb}ing"


def third_person(verb: str) -> str:
    """`go` → `goes`, `carry` → `carries`."""
    if verb.endswith("y") and verb[-2:-1] not in _VOWELS:
        return f"{verb[:-1]}ies"
    return f"{verb}es" if verb.endswith(("o", "s", "x", "ch", "sh")) else f"{verb}s"


def participles(verb: str) -> tuple[str, ...]:
    """`bring` → `brought`, `carry` → `carried`, `grab` → `grabbed`."""
    if verb in _IRREGULAR_PARTICIPLES:
        return _IRREGULAR_PARTICIPLES[verb]
    if _doubles(verb):
        return (f"{verb}{verb[-1]}ed",)
    if verb.endswith("y") and verb[-2:-1] not in _VOWELS:
        return (f"{verb[:-1]}ied",)
    return (f"{verb}d" if verb.endswith("e") else f"{verb}ed",)
