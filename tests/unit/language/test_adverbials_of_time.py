"""What says when, how often or how long is understood or refused by name, wherever it stands."""

from __future__ import annotations

from datetime import UTC, datetime

import pytest

from fleet.errors import NotUnderstood
from fleet.language import Ambiguity, read
from fleet.language.reading import WantedGoal
from tests.support.language_flat_said import SPOKEN, told

NOW = datetime(2026, 3, 4, 9, 30, tzinfo=UTC)
_ADVERBIALS = """
whenever the lamp is on | every time the lamp is on | every time that the lamp is on
each time the lamp is on | always when the lamp is on | any time the lamp is on
as often as the lamp is on | if ever the lamp is on | the first time the lamp is on
the next time the lamp is on | when the lamp is on | once the lamp is on | if the lamp is on
as soon as the lamp is on | as long as the lamp is on | so long as the lamp is on
until the lamp is on | till the lamp is on | while the lamp is on | unless the lamp is on
since the lamp is on | before the lamp is on | after the lamp is on
each morning when the lamp is on | every morning if the lamp is on | when the lamp is on at 5 pm
until noon | till 5 pm | before noon | by noon | after noon | at noon | never before noon
not before noon | in ten minutes | within ten minutes | for ten minutes | for an hour
for a week | for ever | forever | all day | the whole day | all night
throughout the day | during the night | at night | in the mornings | mornings | at the weekend
at weekends | on weekends | on weekdays | only on weekdays | on weekdays only | on Sundays
on Friday | on Mondays and Fridays | every Monday and Friday | every day except on Sundays
every day but not on Sundays | every morning except Sundays | every day apart from Monday
every weekday except Friday at 7 | every other day | every second day | every third hour
every few hours | every 2 days at 7 | every hour between 9 and 5 | every hour from 9 to 5
every two hours | once an hour | once a day | once a week | once a month | once a year
once per hour | twice | twice a day | three times | three times a week | thrice | many times
several times a day | a couple of times | again and again | from time to time | now and then
every now and then | every so often | once in a while | occasionally | regularly | often
sometimes | rarely | seldom | usually | repeatedly | constantly | continuously | frequently
hourly | daily | weekly | nightly | monthly | yearly | every month | every year | every weekend
tomorrow | today | tonight | this evening | next week | next month | later | soon | sometime
someday | eventually | yesterday | between 10 and 11 | from 10 to 11 | from Monday to Friday
by turns | on and off | five minutes later | ten minutes before noon | every day until Friday
every day for a week | on the 3rd of May | over and over again | day in day out
"""
ADVERBIALS = [said.strip() for line in _ADVERBIALS.split("\n") for said in line.split("|") if said]
DEEDS = ("close the fridge", "hsr should bring the fork to the kitchen")
KEPT = ("keep the fridge closed", "never open the fridge")


def goals(text: str) -> tuple[WantedGoal, ...]:
    """What is wanted; nothing, where the text is refused or asked about."""
    found = read(text, SPOKEN, NOW)
    return () if isinstance(found, Ambiguity) else found.goals


PLAIN = {text: goals(text) for text in (*DEEDS, *KEPT)}


@pytest.mark.parametrize("said", list(filter(None, ADVERBIALS)))
def test_no_adverbial_of_time_is_dropped(said: str) -> None:
    words = {word.strip(".,").casefold() for word in said.split()}
    for plain, wanted in PLAIN.items():
        for text in (f"{plain} {said}", f"{said}, {plain}"):
            try:
                found = goals(text)
            except NotUnderstood as refused:
                assert words & set(_words(str(refused))), f"{text}: {refused}"
            else:
                assert found != wanted, f"{text} is {found}"


def _words(sentence: str) -> list[str]:
    return "".join(c if c.isalnum() else " " for c in sentence.casefold()).split()


@pytest.mark.parametrize(
    ("said", "meant"),
    [
        ("once an hour", "every PT1H"),
        ("every other day", "every PT48H"),
        ("on Mondays and Fridays at 7", "every 0 7 * * 1,5"),
        ("only on weekdays", "every 0 8 * * 1-5"),
        ("every day at 7 except on Sundays", "every 0 7 * * 1,2,3,4,5,6"),
        ("at weekends", "every 0 8 * * 0,6"),
        ("not before noon", "in 9000 s"),
        ("every evening at 10", "every 0 22 * * *"),
        ("at 10 every evening", "every 0 22 * * *"),
        ("every evening at half past 6 except on Sundays", "every 30 18 * * 1,2,3,4,5,6"),
        ("between 5 and 6 pm", "in 27000 s, within 30600 s"),
        ("at 5", "in 27000 s"),
        ("at 5 am", "in 70200 s"),
        ("at 10", "in 1800 s"),
        ("between 10 and 3", "in 1800 s, within 19800 s"),
        ("every time that the lamp is on", "each time that is_on(lamp) = true"),
        ("always when the lamp is on", "each time that is_on(lamp) = true"),
    ],
)
def test_what_is_understood_of_them(said: str, meant: str) -> None:
    assert told(read(f"Close the fridge {said}.", SPOKEN, NOW)).endswith(f"= false, {meant}")


@pytest.mark.parametrize(
    "text",
    [
        "Always close the fridge when the lamp is on",
        "When the lamp is on, always close the fridge",
        "If the lamp is on, always close the fridge",
    ],
)
def test_always_with_a_condition_is_each_time(text: str) -> None:
    wanted = "is_open(fridge) = false, each time that is_on(lamp) = true"
    assert told(read(text, SPOKEN, NOW)) == wanted


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("Never open the fridge before noon", "'before noon'"),
        ("Never open the fridge on weekdays", "'on weekdays'"),
        ("Do not open the fridge tomorrow", "'tomorrow'"),
        ("Keep the fridge closed from 9 to 5", "'from 9 to 5'"),
        ("Keep the fridge closed as long as the lamp is on", "as long as"),
        ("Whenever the lamp is on, keep the fridge closed", "Whenever"),
        ("The fridge should always be closed when the lamp is on", "when the lamp is on"),
        ("Never open the fridge when the lamp is on", "when the lamp is on"),
        ("Whenever the lamp is on, close the fridge in ten minutes", "'in ten minutes'"),
        ("Close the fridge every time", "'every time'"),
        ("Close the fridge whenever", "'whenever'"),
        ("If the lamp is on, close the fridge. Then open the cupboard", "comes then"),
        ("Close the fridge at once. When you have time, open the cupboard", "two goals"),
    ],
)
def test_what_would_be_kept_too_long_is_refused(text: str, named: str) -> None:
    with pytest.raises(NotUnderstood) as refused:
        read(text, SPOKEN, NOW)
    assert named in str(refused.value)


@pytest.mark.parametrize(
    ("text", "meant"),
    [
        ("Whenever the lamp is on, close the fridge. Then open the cupboard.",
         "is_open(fridge) = false, then is_open(cupboard) = true, "
         "each time that is_on(lamp) = true"),
        ("At 5 pm, close the fridge. Then open the cupboard.",
         "is_open(fridge) = false, then is_open(cupboard) = true, in 27000 s"),
    ],
)  # fmt: skip
def test_what_comes_then_comes_after_what_waits(text: str, meant: str) -> None:
    assert told(read(text, SPOKEN, NOW)) == meant
