"""The skill decorator, argument checks and the registry."""

from __future__ import annotations

import pytest

from keyexpr_schema.config_files import config_file
from keyexpr_schema.keyspace import OBJECT, PLACE, ROBOT_SPEC
from keyexpr_schema.payloads.robots import RobotAddress, RobotSpec
from keyexpr_schema.payloads.world import Object, ObjectAddress, Place, PlaceAddress
from keyexpr_schema.transport.session import Change
from keyexpr_schema.yaml_reader import read_yaml
from workers.errors import BadArguments, BadSkill, UnknownSkill
from workers.skill_context import SkillContext
from workers.skill_registry import ParameterKind, Skill, SkillRegistry, skill
from workers.skills.household import HOUSEHOLD
from workers.world_cache import WorldCache


@skill(
    "pour",
    parameters={
        "object": ParameterKind.OBJECT,
        "place": ParameterKind.PLACE,
        "litres": ParameterKind.NUMBER,
    },
)
async def pour(ctx: SkillContext, object: str, place: str, litres: float) -> None:
    """Pour something out.

    More than the first line is for readers of the code.
    """


@pytest.fixture
def world() -> WorldCache:
    view = WorldCache()
    cup = Object(object="cup_1", kind="cup", label="cup")
    spec = RobotSpec(robot="locobot", model="locobot", skills=(), capabilities={})
    view.apply(Change(PLACE, PlaceAddress("kitchen"), Place(place="kitchen", label="K"), "1/1"))
    view.apply(Change(OBJECT, ObjectAddress("cup_1"), cup, "1/1"))
    view.apply(Change(ROBOT_SPEC, RobotAddress("locobot"), spec, "1/1"))
    return view


GOOD = {"robot": "hsr", "object": "cup_1", "place": "kitchen", "litres": "0.2"}


def test_arguments_are_bound_by_name_and_type(world: WorldCache) -> None:
    assert pour.bind(GOOD, "hsr", world) == {"object": "cup_1", "place": "kitchen", "litres": 0.2}
    assert pour.about == "Pour something out."


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"robot": "locobot"}, "ordered for robot 'locobot', but this is hsr"),
        ({"place": "kitchn"}, "place must be a known place, not 'kitchn'; known: kitchen"),
        ({"object": "spoon"}, "object must be a known object, not 'spoon'; known: cup_1"),
        ({"litres": "much"}, "litres must be a number, not 'much'"),
        ({"litres": "nan"}, "litres must be a number, not 'nan'"),
        ({"speed": "1"}, "speed is not a parameter; it takes object (a object), place"),
        ({"litres": None}, "litres is missing; it takes"),
    ],
)
def test_wrong_arguments_are_told_apart(
    world: WorldCache, change: dict[str, str | None], sentence: str
) -> None:
    args = {k: v for k, v in {**GOOD, **change}.items() if v is not None}
    with pytest.raises(BadArguments) as caught:
        pour.bind(args, "hsr", world)
    assert sentence in str(caught.value)


def test_the_household_skills_have_the_names_that_planners_use() -> None:
    raw = read_yaml(config_file("skills", "household"), ValueError)["skills"]
    assert {one.name: ["robot", *one.parameters] for one in HOUSEHOLD} == {
        name: list(entry["parameters"]) for name, entry in raw.items()
    }


def test_an_unknown_skill_is_answered_with_those_there_are() -> None:
    registry = SkillRegistry(HOUSEHOLD)
    assert registry.get("pick", ["pick"]).name == "pick"
    with pytest.raises(UnknownSkill, match=r"no skill 'fly'.*carries out navigate, search"):
        registry.get("fly", ["navigate", "search"])
    with pytest.raises(UnknownSkill, match=r"does not offer skill 'pick'.*navigate"):
        registry.get("pick", ["navigate"])


def test_two_skills_of_one_name_are_refused() -> None:
    with pytest.raises(BadSkill, match="two skills are called 'pick'"):
        SkillRegistry([*HOUSEHOLD, Skill("pick", {}, pour.function)])


def test_what_is_no_skill_is_refused_where_it_is_written() -> None:
    with pytest.raises(BadSkill, match="must be an `async def`"):

        @skill("a")
        def not_async(ctx: SkillContext) -> None: ...  # type: ignore[arg-type]

    with pytest.raises(BadSkill, match=r"takes \(ctx, thing\).*want \(ctx, place\)"):

        @skill("b", parameters={"place": ParameterKind.PLACE})
        async def other_names(ctx: SkillContext, thing: str) -> None: ...

    with pytest.raises(BadSkill, match="not valid"):

        @skill("not an id")
        async def fine(ctx: SkillContext) -> None: ...


def test_installed_skills_come_from_entry_points_and_broken_ones_are_left_out(
    tmp_path_factory: pytest.TempPathFactory,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    site = tmp_path_factory.mktemp("site")
    (site / "their_skills.py").write_text(
        "from workers.skill_registry import skill\n"
        "@skill('wave')\n"
        "async def wave(ctx):\n"
        "    '''Wave.'''\n"
        "nothing = 5\n"
    )
    info = site / "their_skills-1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: their-skills\nVersion: 1\n")
    (info / "entry_points.txt").write_text("[robotfleet.skills]\nwave = their_skills:wave\n")
    monkeypatch.syspath_prepend(site)
    assert "wave" in [one.name for one in SkillRegistry.installed(HOUSEHOLD)]
    (info / "entry_points.txt").write_text(
        "[robotfleet.skills]\n"
        "nothere = their_skills:nothere\n"
        "five = their_skills:nothing\n"
        "again = workers.skills.navigate:navigate\n"
        "wave = their_skills:wave\n"
    )
    names = {one.name for one in SkillRegistry.installed(HOUSEHOLD)}
    assert names == {"wave", *(one.name for one in HOUSEHOLD)}
    assert [record.getMessage().partition("cannot be used: ")[2] for record in caplog.records] == [
        "AttributeError: module 'their_skills' has no attribute 'nothere'",
        "BadSkill: it offers 5, which is no @skill",
        "BadSkill: two skills are called 'navigate': rename or remove one",
    ]
