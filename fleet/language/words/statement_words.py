"""Phrases that statements about the world use. Matched longest first."""

from __future__ import annotations

from fleet.language.words.wordlists import phrases

SAID_OPENERS = phrases(
    "please note that|note that|please note|note|please remember that|remember that|remember|fyi|"
    "i know that|i know|we know that|we know|i can see that|i see that|it is known that|"
    "it is true that|the fact is that|know that|please|now|currently|also|hello|hey|ok|okay|"
    "right now|at the moment|so|well"
)
SAID_CLOSERS = phrases(
    "now|right now|currently|at the moment|please|thanks|thank you|already|too|as well|at present"
)
NOBODY_KNOWS = phrases(
    "nobody knows where|no one knows where|nobody knows|no one knows|i do not know where|"
    "we do not know where|it is unknown where|it is not known where|it is unclear where|"
    "i have no idea where|nobody can say where|no one can say where|no idea where|"
    "nobody has any idea where|unknown where|i forgot where|who knows where|no one can tell where|"
    "nobody can tell where|nobody is sure where|i am not sure where"
)
WHEREABOUTS = phrases(
    "the location of|the position of|the whereabouts of|the place of|location of|whereabouts of"
)
UNKNOWN = phrases(
    "unknown|not known|lost|missing|somewhere|anywhere|not to be found|misplaced|"
    "nowhere to be found|in an unknown place|in some unknown place|at an unknown place|"
    "unknown to us|gone|gone missing"
)
SEARCH_PARTICIPLES = phrases(
    "searched|inspected|checked|explored|patrolled|surveyed|scanned|examined"
)
PEOPLE = phrases("i|we|somebody|someone|people")
NOBODY = phrases("nobody|no one|no robot")
PUT = phrases(
    "put|left|placed|saw|see|found|stored|just put|just left|just saw|have put|have left|"
    "have seen|have placed|can see|noticed|dropped|set|laid|keep"
)
GRIPPING = phrases("holds|is holding|is gripping|grips|has in its hand")
CARRYING = phrases(
    "carries|is carrying|has|has got|transports|is transporting|contains|has in its basket"
)
HOUSES = phrases("contains|has|houses|holds")
