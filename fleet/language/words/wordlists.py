"""The words that the grammar itself knows. Multi-word entries are matched longest first."""

from __future__ import annotations

from fleet.language.words.tokens import Phrase, tokens_of, words_in


def phrases(texts: str) -> tuple[Phrase, ...]:
    """Phrases, written with `|` between them, as words; the longest first."""
    found = {tuple(token.word for token in tokens_of(text)) for text in texts.split("|")}
    return tuple(sorted(found, key=lambda p: (-len(p), p)))


# --- where ---------------------------------------------------------------------------------------
TO = phrases("to|into|onto|over to|back to|up to|back into|back in|back on")
IN = phrases("in|inside|inside of|within|on|on top of|at|back at")
FROM = phrases("from|out of|off|off of|away from")
PREPOSITIONS = frozenset(preps[0] for group in (TO, IN, FROM) for preps in group)
RELATIVE = phrases("that is|that are|which is|which are|that 's|which 's")
HOME = phrases(
    "home|back home|where it belongs|where they belong|back where it belongs|"
    "back where they belong|to where it belongs|to where they belong|back to where it belongs|"
    "back to where they belong|to its home|to their homes|to its place|to their places|"
    "in its place|in their places|back in its place|back in their places|to its own place|"
    "back to its place|back to their places|back to its home|back to their homes"
)
ANYWHERE = phrases("somewhere|anywhere|wherever it is|wherever they are")
WHOLE_HOUSE = phrases(
    "the house|the whole house|the entire house|the apartment|the whole apartment|the home|"
    "the whole home|the flat|the whole flat|the building|the whole building|everywhere|house|"
    "everything|the entire apartment|the entire home|the entire flat|the entire building"
)
SPEAKER = frozenset({"me", "us"})
BASKETS = frozenset({"basket", "tray"})

# --- who and how many ----------------------------------------------------------------------------
DEFINITE = frozenset(words_in("the my our your his her their its this that these those"))
INDEFINITE = frozenset({"a", "an", "any", "some", "either"})
UNIVERSAL = frozenset({"all", "every", "each", "both"})
SINGULAR_PRONOUNS = frozenset({"it", "this", "that"})
PLURAL_PRONOUNS = frozenset(words_in("them they these those both all each"))
EVERYTHING = phrases("everything")
ANYTHING = phrases("anything|something")
EVERYONE = phrases("everyone|everybody")

# --- politeness: words that change nothing of what must hold -------------------------------------
OPENERS = phrases(
    "please|kindly|could you|can you|would you|will you|could you please|can you please|"
    "would you please|will you please|could someone|can someone|i want you to|i need you to|"
    "i would like you to|we want you to|we need you to|we need to|you should|you must|you have to|"
    "you need to|your task is to|your job is to|the task is to|the goal is to|would you mind|"
    "do you mind|let us|let 's|lets|go and|come and|go on and|hey|hello|hi|hello there|ok|okay|so|"
    "now|just|also|try to|be so kind and|be so kind as to|i would appreciate it if you could|"
    "start by|how about|somebody|someone|firstly|first of all|all right|alright|well|oh|"
    "somebody should|someone should|somebody must|someone must|somebody has to|someone has to|"
    "somebody needs to|someone needs to|somebody please|someone please|one of you should|"
    "it would be nice if you could|i would be glad if you could"
)
CLOSERS = phrases(
    "please|thanks|thank you|thank you very much|many thanks|thanks a lot|for me|for us|now|"
    "right now|right away|immediately|at once|as soon as possible|as soon as you can|asap|too|"
    "as well|also|will you|would you|could you|"
    "can you|ok|okay|if you please|if you would|if you can|if possible|when you can|cheers"
)
NEXT = phrases(
    "then|and then|after that|and after that|afterwards|and afterwards|next|and next|finally|"
    "and finally|lastly|and lastly|subsequently|then finally|and then finally|after which|"
    "followed by|once that is done|when that is done|when done|and when that is done|thereafter|"
    "secondly|thirdly|then next|and subsequently|once done|when you are done|and once that is done"
)
WANTING = phrases(
    "i want|i need|we want|we need|i would like|we would like|i would like to have|i want to have|"
    "i would like to see|i want to see|we would like to have|i would love|i would love to have|"
    "we would love to have"
)
ENSURING = phrases(
    "make sure|make sure that|ensure|ensure that|see to it that|see to it|be sure that|"
    "take care that|make certain that|it should be that|i want that|the goal is that|"
    "it must be true that|the goal is for|guarantee that|making sure that"
)
CAUSATIVES = phrases("let|have|tell|ask|order|command|instruct|make")
ENOUGH = phrases(
    "would do|will do|would suffice|would be fine|is fine|would be enough|is enough|would be ok|"
    "is ok|would be okay|is okay|would be good|would be great|would be nice|would be perfect|"
    "would be all right|is all right"
)
REMARKS = phrases("i am|i have|i feel|i have got|we are|we have|we feel|we have got")
"""How a sentence begins in which a person speaks of themselves, which asks for nothing."""
MODALS = phrases(
    "should|must|shall|has to|have to|needs to|need to|ought to|is to|are to|can|could|would|will|"
    "is supposed to|are supposed to"
)
COPULAR_VERBS = frozenset(
    words_in("is are be 's stands stand lies lie sits sit rests rest stays stay being standing")
)
SITUATED = phrases(
    "located|placed|now|currently|still|already|standing|lying|sitting|both|all|present|found|"
    "right now|somewhere|to be found|kept|stored"
)
ASKING_WHERE = phrases(
    "where is|where are|where 's|find out where|tell me where|do you know where|"
    "can you tell me where|could you tell me where|i want to know where|show me where|"
    "i need to know where|i would like to know where|i wonder where|say where|check where|"
    "let me know where|see where"
)

GRAMMAR_WORDS = (
    DEFINITE
    | INDEFINITE
    | UNIVERSAL
    | SINGULAR_PRONOUNS
    | PLURAL_PRONOUNS
    | COPULAR_VERBS
    | frozenset(words_in("and or then of not no there here has have been"))
    | frozenset(word for preps in (TO, IN, FROM) for prep in preps for word in prep)
)
"""Words that never count as a description of a thing; they may still be part of a whole name."""

PLACE_SYNONYMS = (
    ("living room", "lounge", "sitting room", "parlour", "parlor"),
    ("hallway", "hall", "corridor", "passage"),
    ("bathroom", "bath", "washroom", "restroom"),
    ("toilet", "loo", "lavatory"),
    ("bedroom", "sleeping room"),
    ("office", "study"),
    ("entrance", "entry", "foyer", "lobby"),
    ("storage", "storage room", "store room", "storeroom", "pantry"),
    ("laundry", "laundry room", "utility room"),
    ("lab", "laboratory"),
)
"""Names in common use for the same room; one counts where just one place can be meant."""
