"""Telling the fleet of its world, thing by thing."""

from __future__ import annotations

from pathlib import Path

import pytest

from cli.client.publish import put_fact
from cli.client.world import put_object, put_place, put_world
from keyexpr_schema.facts import AT
from keyexpr_schema.keyspace import REGION
from keyexpr_schema.payloads.closures import Region, RegionAddress, RegionKind
from keyexpr_schema.transport.session import SessionConfig, open_session
from sim.files.world_file import load_world
from sim.files.world_payloads import object_payloads, place_payloads
from tests.support.planner_process import person, planner
from tests.support.robotctl import Robotctl
from tests.support.router_process import RouterProcess

WORLD = str(Path(__file__).parents[3] / "configs" / "worlds" / "home.yaml")


@pytest.fixture
def robotctl(router: RouterProcess, tmp_path: Path) -> Robotctl:
    return Robotctl(router.endpoint, tmp_path, "test")


def test_the_world_is_loaded_said_listed_and_forgotten(robotctl: Robotctl) -> None:
    unknown = robotctl("world", "add", "--fact", "at", "cup_1", "kitchen")
    assert unknown.code == 1
    assert "load a world with `robotctl world load FILE`" in unknown.err

    assert robotctl("world", "load", WORLD).code == 0
    assert robotctl("world", "add", "The first cup is in the kitchen.").code == 0
    assert robotctl("world", "add", "The first cup is in the kitchen.").code == 0
    said = robotctl("world", "add", "--fact", "at", "cup_1", "kitchen")
    assert said.out.strip() == "stored at(cup_1) = kitchen"
    wrong = robotctl("world", "add", "--fact", "at", "cup_1", "kitchn")
    assert "(did you mean 'kitchen'?)" in wrong.err
    shut = robotctl("world", "add", "--fact", "is_open", "cup_1", "true")
    assert shut.code == 1
    assert "is_open is said of openable, and cup_1 is none" in shut.err
    assert "got 2 words" in robotctl("world", "add", "--fact", "at", "cup_1").err

    world = robotctl("world", "list", "--json").data
    assert [place["place"] for place in world["places"]] == ["hallway", "kitchen", "living_room"]
    moved = [thing["object"] for thing in world["objects"] if thing["movable"]]
    assert moved == ["cup_1", "cup_2"]
    assert [fact["value"] for fact in world["facts"]] == ["kitchen"]
    assert [s["text"] for s in world["statements"]] == ["The first cup is in the kitchen."]
    page = robotctl("world", "list").out
    assert "at(cup_1) = kitchen" in page
    assert "The first cup is in the kitchen." in page

    assert robotctl("world", "delete", "at", "cup_1").out.strip() == "deleted at(cup_1)"
    statement = world["statements"][0]["statement"]
    assert robotctl("world", "delete", statement).code == 0
    assert robotctl("world", "delete", "cup_2").out.strip() == "deleted object cup_2"
    assert "did you mean 'cup_1'?" in robotctl("world", "delete", "cup_2").err
    left = robotctl("world", "list", "--json").data
    assert left["facts"] == left["statements"] == []


def test_objects_are_told_one_by_one(robotctl: Robotctl) -> None:
    robotctl("world", "load", WORLD)
    said = robotctl("world", "add", "--object", "cup_3", "--kind", "cup", "--home", "kitchen")
    assert said.out.strip() == "stored object cup_3: “cup 3”, a cup"
    heavy = robotctl(
        *("world", "add", "--object", "cup_3", "--kind", "cup", "--label", "the red cup"),
        *("--mass-kg", "0.4", "--alias", "mug", "--json"),
    ).data
    assert heavy["ordinal"] == 3
    assert heavy["home"] == "kitchen"
    assert (heavy["label"], heavy["aliases"], heavy["mass_kg"]) == ("the red cup", ["mug"], 0.4)
    page = robotctl("world", "list").out
    assert "the red cup" in page
    assert "mug" in page
    wrong = robotctl("world", "add", "--object", "x", "--kind", "cup", "--home", "kitchn")
    assert "(did you mean 'kitchen'?)" in wrong.err
    taken = robotctl("world", "add", "--object", "kitchen", "--kind", "cup")
    assert "'kitchen' is a place already" in taken.err


def test_what_others_can_be_on_is_told_with_its_features(robotctl: Robotctl) -> None:
    robotctl("world", "load", WORLD)
    desk = ("world", "add", "--object", "desk", "--kind", "desk", "--fixed", "--home", "kitchen")
    robotctl(*desk)
    drawer = robotctl(
        *("world", "add", "--object", "drawer", "--kind", "drawer", "--part-of", "desk"),
        *("--feature", "contains", "--feature", "openable", "--json"),
    ).data
    assert (drawer["features"], drawer["part_of"]) == (["contains", "openable"], "desk")
    assert "openable" in robotctl("world", "list").out
    said = robotctl("world", "add", "--fact", "in", "cup_1", "drawer")
    assert said.out.strip() == "stored at(cup_1) = drawer"
    wrong = robotctl("world", "add", "--fact", "at", "cup_1", "cup_1")
    assert "cannot be on or in itself" in wrong.err
    robotctl("register", "hsr")
    capital = robotctl("register", "hsr", "--as", "HSR").err
    assert "'hsr' is a robot already; choose another name" in capital
    held = robotctl("world", "add", "--fact", "holding", "hsr", "kitchen")
    assert held.code == 1 and "there is no object 'kitchen'" in held.err
    full = robotctl("world", "add", "--fact", "charge", "hsr", "9999")
    assert "a charge is a number of percent from 0 to 100, and not 9999" in full.err
    robotctl("world", "add", "--object", "anna", "--kind", "person")
    goal = ("goal", "add", "Bring me the first cup.")
    assert robotctl(*goal, "--speaker", "anna", "--json").data["spec"]["speaker"] == "anna"
    assert (
        "there is no person 'ana' (did you mean 'anna'?)" in robotctl(*goal, "--speaker", "ana").err
    )


def test_places_are_told_one_by_one(robotctl: Robotctl) -> None:
    robotctl("world", "load", WORLD)
    told = robotctl(
        *("world", "add", "--place", "pantry", "--alias", "larder", "--json"),
        *("--region", "0,0,1.5,2", "--distance", "kitchen=2.5"),
    ).data
    assert told["region_m"] == [[0.0, 0.0, 1.5, 2.0]]
    places = {each["place"]: each for each in robotctl("world", "list", "--json").data["places"]}
    assert places["pantry"]["travel_m"] == {"kitchen": 2.5}
    assert places["kitchen"]["travel_m"]["pantry"] == 2.5
    assert places["kitchen"]["travel_m"]["hallway"] > 0.0
    assert places["kitchen"]["surfaces"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--object", "x"], "an object has a --kind"),
        ([], "say a sentence, or tell of"),
        (["--object", "x", "--kind", "cup", "--place", "y"], "--object and --place are different"),
        (["A cup.", "--place", "y"], "a sentence and --place are different"),
        (["A cup.", "--kind", "cup"], "--kind goes with --object"),
        (["--place", "y", "--home", "kitchen"], "--home goes with --object"),
        (["--place", "a b"], "place 'a b' is not valid"),
        (["--place", "y", "--region", "1,2,3"], "region '1,2,3' is not X_MIN"),
        (["--place", "y", "--region", "1,1,0,2"], "is not X_MIN"),
        (["--place", "y", "--distance", "kitchen"], "is not PLACE=METRES"),
        (["--place", "y", "--distance", "nowhere=1"], "there is no place 'nowhere'"),
    ],
)
def test_what_makes_no_sense_is_one_sentence(
    robotctl: Robotctl, arguments: list[str], words: str
) -> None:
    said = robotctl("world", "add", *arguments)
    assert said.code == 1
    assert said.out == ""
    assert words in said.err
    assert said.err.count("\n") == 1


async def test_a_statement_tells_how_it_was_read(
    router: RouterProcess, robotctl: Robotctl, tmp_path: Path
) -> None:
    async with person(router.endpoint), planner(router.endpoint, tmp_path / "planner"):
        read = await robotctl.soon("world", "add", "Cup 1 is in the hallway.")
        unread = await robotctl.soon("world", "add", "The weather is fine.")
        page = (await robotctl.soon("world", "list")).out
    assert "understood as at(cup_1) = hallway" in read.out
    assert unread.code == 1
    assert unread.err.count("\n") == 1
    assert "“The weather is fine.”, not understood: 'The weather' is not" in unread.err
    assert "not understood: 'The weather'" in page  # and it is kept


def test_a_planner_that_is_told_nonsense_says_so(robotctl: Robotctl, tmp_path: Path) -> None:
    llm = tmp_path / "llm.yaml"
    llm.write_text("llm: {modle: x}")
    for option, file, words in (
        ("--llm-config", "nowhere.yaml", "nowhere.yaml cannot be read"),
        ("--llm-config", str(llm), "llm.modle: there is no such field"),
        ("--skills", "nowhere.yaml", "nowhere.yaml cannot be read"),
        ("--words", "nowhere.yaml", "nowhere.yaml cannot be read"),
    ):
        said = robotctl("planner", "--data", str(tmp_path / "data"), option, file)
        assert said.code == 1
        assert words in said.err
    assert robotctl("planner", "--lost-after", "-1").code == 2


def test_facts_of_nothing_and_of_no_relation_are_refused(robotctl: Robotctl) -> None:
    assert robotctl("world", "add", "--object", "lamp", "--kind", "lamp").code == 0
    for words, said in (
        (("is_on", "lmap", "true"), "no object, place or robot 'lmap' (did you mean 'lamp'?)"),
        (("is_onn", "lamp", "true"), "no relation 'is_onn' (did you mean 'is_on'?)"),
    ):
        wrong = robotctl("world", "add", "--fact", *words)
        assert wrong.code == 1
        assert said in wrong.err
    # Skills of a planner's own may speak of it, and there is no planner to say so.
    told = robotctl("world", "add", "--fact", "colour", "lamp", "red")
    assert (told.code, told.out) == (0, "stored colour(lamp) = red\n")
    assert "no skill that is known here speaks of 'colour'" in told.err


async def test_a_world_takes_the_place_of_another(
    router: RouterProcess, robotctl: Robotctl
) -> None:
    world = load_world(WORLD)
    async with open_session(SessionConfig((router.endpoint,), "test", "test")) as session:
        await put_world(session, place_payloads(world), object_payloads(world))
        await put_place(session, "pantry", None, (), (), ())
        await put_object(session, "vase", "vase", None, (), None, None)
        hatch = Region(region="hatch", kind=RegionKind.DOOR, region_m=((0.0, 0.0, 1.0, 1.0),))
        await session.confirm(REGION, RegionAddress("hatch"), hatch)
        for name, place in (("vase", "pantry"), ("cup_1", "pantry"), ("cup_2", "kitchen")):
            await put_fact(session, AT, name, place)
    told = (await robotctl.soon("world", "load", WORLD, "--replace", "--json")).data
    assert told["forgotten"] == ["pantry", "hatch", "vase"]
    unknown = await robotctl.soon("world", "close", "hatch")
    assert "there is no place, door or zone 'hatch'" in unknown.err
    assert sorted(told["forgotten_facts"]) == ["at(cup_1)", "at(vase)"]
    left = (await robotctl.soon("world", "list", "--json")).data
    assert {each["subject"] for each in left["facts"]} == {"cup_2"}
    assert "vase" not in {each["object"] for each in left["objects"]}
    assert all("@" in each["by"] for each in (*left["objects"], *left["places"])), "who said so"

    nothing = await robotctl.soon("world", "delete", "at(cup_2)", "cup_1", "vase")
    assert nothing.code == 1
    assert "there is no statement, object or place 'vase'" in nothing.err
    gone = (await robotctl.soon("world", "delete", "at(cup_2)", "cup_1", "kitchen", "--json")).data
    assert gone == {"deleted": ["at(cup_2)", "object cup_1", "place kitchen"]}
