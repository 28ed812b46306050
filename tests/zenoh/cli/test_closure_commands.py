"""`robotctl world close` and `open`."""

from __future__ import annotations

from tests.support.robotctl import Robotctl


def test_what_is_closed_is_listed_and_each_ends_by_itself(robotctl: Robotctl) -> None:
    robotctl("world", "load", "home")
    closed = robotctl(
        "world", "close", "kitchen_door", "hallway", "--as", "ana", "--why", "wet", "--json"
    )
    assert closed.code == 0, closed.err
    assert [each["names"] for each in closed.data] == [["kitchen_door"], ["hallway"]]
    assert closed.data[0]["region_m"] == [[3.95, 2.5, 4.05, 3.5]]
    boxed = robotctl("world", "close", "--box", "5.5,2,6.5,4", "--until", "2h", "--one-at-a-time")
    assert "living_room_door is open to one robot at a time" in boxed.out
    shown = " ".join(robotctl("status").out.split())
    assert "kitchen_door is closed by ana (wet) (`robotctl world open kitchen_door`)" in shown
    assert "living_room_door is open to one robot at a time" in shown and ", until " in shown
    bare = robotctl("world", "close", "--box", "9,9,9.5,9.5", "--json").data[0]["closure"]
    shown = " ".join(robotctl("status").out.split())
    assert "the floor from (9, 9) to (9.5, 9.5) m is closed" in shown
    assert f"`robotctl world open {bare}`" in shown
    assert robotctl("world", "open", bare).code == 0
    opened = robotctl("world", "open", "kitchen_door")
    assert opened.out == "no longer: kitchen_door is closed by ana (wet)\n"
    assert len(robotctl("status", "--json").data["closures"]) == 2
    assert len(robotctl("world", "open", "--all", "--json").data) == 2
    assert robotctl("world", "close", "hallway", "--until", "0s").code == 0, "over at once"
    assert robotctl("world", "open", "--all").out == "Nothing is closed.\n"


def test_what_cannot_be_closed_is_said(robotctl: Robotctl) -> None:
    robotctl("world", "load", "home")
    robotctl("world", "add", "--place", "garden")
    for words, said in (
        (["kitchn"], "there is no place, door or zone 'kitchn' (did you mean 'kitchen'?)"),
        (["garden"], "nobody knows where garden is: it has no region, give --box"),
        (["kitchen", "--for", "hrs"], "there is no model of a registered robot 'hrs'"),
        (["--box", "1,2,3"], "--box '1,2,3' is not four lengths in metres"),
        (["--box", "3,2,1,4"], "X_MIN,Y_MIN,X_MAX,Y_MAX"),
        (["kitchen", "--until", "soon"], "--until 'soon' is neither a time"),
        ([], "name a place, a door or a zone"),
        (["kitchen", "--one-at-a-time", "--for", "hsr"], "--one-at-a-time is for all robots"),
    ):
        done = robotctl("world", "close", *words)
        assert done.code != 0 and said in " ".join(done.err.replace("│", " ").split()), done.err
    unknown = robotctl("world", "open", "kitchen")
    assert unknown.code == 1 and "there is no closure 'kitchen'" in unknown.err
    assert robotctl("status", "--json").data["closures"] == []
