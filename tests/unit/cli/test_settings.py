"""Where robotctl finds its fleet: flag, environment, file, default."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import pytest

from cli.errors import BadSettings
from cli.processes.data_folder import data_folder
from cli.settings import DEFAULT_REALM, DEFAULT_ROUTER, PlannerSettings, load_settings
from fleet.core.state import Policy
from fleet.service.leases import check_lease
from keyexpr_schema.limits import Limits

A, B, C = "tcp/127.0.0.1:1", "tcp/127.0.0.1:2", "tls/[::1]:3"


def test_defaults(tmp_path: Path) -> None:
    settings = load_settings(None, None, False, {}, tmp_path)
    assert settings.routers == (DEFAULT_ROUTER,)
    assert settings.realm == DEFAULT_REALM


def test_flag_beats_environment_beats_file(tmp_path: Path) -> None:
    (tmp_path / "robotctl.yaml").write_text(f"router: {C}\nrealm: from-file\n")
    env = {"ROBOTFLEET_ROUTER": f"{A}, {B}", "ROBOTFLEET_REALM": "from-env"}

    from_file = load_settings(None, None, False, {}, tmp_path)
    assert (from_file.routers, from_file.realm) == ((C,), "from-file")
    from_env = load_settings(None, None, False, env, tmp_path)
    assert (from_env.routers, from_env.realm) == ((A, B), "from-env")
    from_flags = load_settings([B], "from-flag", False, env, tmp_path)
    assert (from_flags.routers, from_flags.realm) == ((B,), "from-flag")


def test_who_gives_a_command_is_said_in_the_same_places(tmp_path: Path) -> None:
    assert load_settings(None, None, False, {}, tmp_path).by is None
    (tmp_path / "robotctl.yaml").write_text("as: ana\n")
    env = {"ROBOTFLEET_AS": "bob@lab"}
    assert load_settings(None, None, False, {}, tmp_path).by == "ana"
    assert load_settings(None, None, False, env, tmp_path).by == "bob@lab"
    assert load_settings(None, None, False, env, tmp_path, by="the night shift").by == (
        "the night shift"
    )


def test_which_file(tmp_path: Path) -> None:
    home, here, named = tmp_path / "home", tmp_path / "here", tmp_path / "named.yaml"
    (home / ".config" / "robotfleet").mkdir(parents=True)
    here.mkdir()
    (home / ".config" / "robotfleet" / "robotctl.yaml").write_text("realm: at-home\n")
    env = {"HOME": str(home)}
    assert load_settings(None, None, False, env, here).realm == "at-home"
    (here / "robotctl.yaml").write_text("realm: here\n")
    assert load_settings(None, None, False, env, here).realm == "here"
    named.write_text(f"router: [{A}, {B}]\n")
    told = load_settings(None, None, False, {**env, "ROBOTFLEET_CONFIG": str(named)}, here)
    assert (told.routers, told.realm) == ((A, B), DEFAULT_REALM)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("router: [", "is not YAML"),
        ("- a\n- b\n", "must hold fields"),
        ("rooter: x\n", "field 'rooter'; valid are: router, realm, as, zenoh_config, planner"),
        ("planner: [approval]\n", "planner must hold fields such as"),
        ("planner: {aproval: true}\n", "planner has no field 'aproval'; valid are: approval,"),
        ("planner: {approval: 1}\n", "planner.approval: 1 is not true or false"),
        ("planner: {lost_after_s: .inf}\n", "planner.lost_after_s: .inf is no number"),
        ("planner: {lost_after_s: -1}\n", "planner.lost_after_s: -1 is not a number"),
        ("planner: {lost_after_s: soon}\n", "planner.lost_after_s: 'soon' is not a number"),
        ("planner: {planning_limit_s: 0.5}\n", "planner.planning_limit_s: 0.5 is not a number"),
        ("planner: {skills: [1]}\n", "planner.skills: [1] is not the name of a file"),
        ("planner: {tasks: 3}\n", "planner.tasks: 3 is not the name of a file"),
        ("router: localhost\n", "'localhost' is not a Zenoh endpoint"),
        ("router: {a: 1}\n", "must be an endpoint or a list"),
        ("realm: 'a b'\n", "'a b' is not a realm"),
        ("realm: 7\n", "7 is not a realm"),
        ("zenoh_config: 7\n", "zenoh_config: 7 is not the name of a file"),
    ],
)
def test_a_bad_file_is_named_in_one_sentence(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "robotctl.yaml").write_text(text)
    with pytest.raises(BadSettings, match=r"robotctl\.yaml") as error:
        load_settings(None, None, False, {}, tmp_path)
    assert words in str(error.value)
    assert "\n" not in str(error.value)


def test_a_named_file_must_exist(tmp_path: Path) -> None:
    with pytest.raises(BadSettings, match="ROBOTFLEET_CONFIG names 'nowhere'"):
        load_settings(None, None, False, {"ROBOTFLEET_CONFIG": "nowhere"}, tmp_path)


def test_a_bad_flag_or_variable_is_named() -> None:
    with pytest.raises(BadSettings, match="--router: 'x' is not"):
        load_settings(["x"], None, False, {}, Path("/nowhere"))
    for nobody in (" ", "a\x1b[2Jb", "x" * 101):
        with pytest.raises(BadSettings, match="does not say who gives the command"):
            load_settings(None, None, False, {}, Path("/nowhere"), by=nobody)
    with pytest.raises(BadSettings, match="ROBOTFLEET_REALM: '/' is not"):
        load_settings(None, None, False, {"ROBOTFLEET_REALM": "/"}, Path("/nowhere"))


def test_a_zenoh_configuration_is_found_by_flag_variable_and_file(tmp_path: Path) -> None:
    names = ("flag", "variable", "file")
    for name in names:
        (tmp_path / f"{name}.json5").write_text(f"{{connect: {{endpoints: ['tcp/{name}:1']}}}}")
    (tmp_path / "robotctl.yaml").write_text("zenoh_config: file.json5")
    variable = {"ROBOTFLEET_ZENOH_CONFIG": str(tmp_path / "variable.json5")}
    flag = tmp_path / "flag.json5"
    found = [
        load_settings(None, None, False, variable, tmp_path, zenoh_config=flag),
        load_settings(None, None, False, variable, tmp_path),
        load_settings(None, None, False, {}, tmp_path),
    ]
    assert [each.zenoh_config for each in found] == [tmp_path / f"{name}.json5" for name in names]
    assert [each.routers for each in found] == [(f"tcp/{name}:1",) for name in names]
    assert all(each.said for each in found)
    named = load_settings(["tcp/named:1"], None, False, variable, tmp_path)
    assert named.routers == ("tcp/named:1",)


def test_a_router_may_be_found_by_multicast(tmp_path: Path) -> None:
    file = tmp_path / "zenoh.json5"
    file.write_text("{scouting: {multicast: {enabled: true}}}")
    assert load_settings(None, None, False, {}, tmp_path, zenoh_config=file).routers == ()


def test_the_planner_is_told_its_ways_in_the_file(tmp_path: Path) -> None:
    assert load_settings(None, None, False, {}, tmp_path).planner == PlannerSettings()
    (tmp_path / "robotctl.yaml").write_text(
        "planner: {approval: true, lost_after_s: 5, planning_limit_s: 7.5, "
        "llm_config: llm.yaml, skills: [a.yaml, /b.yaml], words: own.yaml, tasks: t.yaml}"
    )
    assert load_settings(None, None, False, {}, tmp_path).planner == PlannerSettings(
        approval=True,
        auto_plan=None,
        lost_after_s=5.0,
        planning_limit_s=7.5,
        llm_config=tmp_path / "llm.yaml",
        skills=(tmp_path / "a.yaml", Path("/b.yaml")),
        tasks=(tmp_path / "t.yaml",),
        words=(tmp_path / "own.yaml",),
    )


def test_the_file_to_copy_is_right_with_every_comment_taken_away(tmp_path: Path) -> None:
    text = (Path(__file__).parents[3] / "configs" / "robotctl.yaml").read_text()
    (tmp_path / "robotctl.yaml").write_text(
        text.replace("# planner:", "planner:")
        .replace("# router:", "router:")
        .replace("# limits:", "limits:")
        .replace("#  ", "")
    )
    settings = load_settings(None, None, False, {}, tmp_path)
    assert Limits(**settings.limits) == Limits()
    assert set(settings.limits) == {field.name for field in fields(Limits)}
    told = settings.planner
    assert (told.approval, told.auto_plan, told.lost_after_s) == (True, True, 30.0)
    check_lease(told.lease_s or 0.0, told.lost_after_s or 0.0)
    assert told.planning_limit_s == Policy().planning_limit_s
    assert told.llm_config == tmp_path / "planner.yaml"


def test_what_a_process_keeps_lies_in_a_folder_of_its_realm(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    north, south = (data_folder(None, "planner", realm) for realm in ("north", "south"))
    assert north == tmp_path / "robotfleet" / "north" / "planner" != south
    assert data_folder(None, "router") == tmp_path / "robotfleet" / "router"
    assert data_folder(tmp_path / "here", "planner", "north") == tmp_path / "here"


def test_limits_are_read_and_wrong_ones_are_told(tmp_path: Path) -> None:
    file = tmp_path / "robotctl.yaml"
    file.write_text("limits: {goals: 100, slow_reader_s: 0.5}\n")
    limits = Limits(**load_settings(None, None, False, {}, tmp_path).limits)
    assert (limits.goals, limits.slow_reader_s, limits.keys) == (100, 0.5, Limits().keys)
    for wrong, said in (
        ("goals: 0", "0 is not a whole number from 1 up"),
        ("goals: 1.5", "1.5 is not a whole number"),
        ("facts: many", "'many' is not a whole number"),
        ("ahead_s: true", "True is not a number above 0"),
        ("cups: 3", "has no field 'cups'; valid are: value_kb, "),
    ):
        file.write_text(f"limits: {{{wrong}}}\n")
        with pytest.raises(BadSettings, match=said):
            load_settings(None, None, False, {}, tmp_path)
