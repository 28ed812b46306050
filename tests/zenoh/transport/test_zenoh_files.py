"""A user's Zenoh configuration: what of it holds, and what is refused in a sentence."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from cli.processes.child_processes import free_endpoint
from keyexpr_schema.errors import BadZenohConfig, Unreachable
from keyexpr_schema.transport.connecting import zenoh_config
from keyexpr_schema.transport.router import run_router
from keyexpr_schema.transport.session import SessionConfig, open_session
from keyexpr_schema.transport.zenoh_file import ZenohFile, read_zenoh_file


def written(folder: Path, text: str, name: str = "zenoh.json5") -> Path:
    path = folder / name
    path.write_text(text, encoding="latin-1")
    return path


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("{", ", line 1: expected identifier"),
        ("{\n nonsense: 1}", ", line 2: unknown field `nonsense`, expected one of `id`,"),
        ("", ": Empty config file"),
        ("\xff", ": stream did not contain valid UTF-8"),
        ("{connect: {endpoints: ['foo']}}", ", line 1: Endpoints must be of the form"),
        ("{connect: {endpoints: ['http/a:1']}}", "'http' is none of its protocols"),
        ("{listen: {endpoints: ['tcp/0.0.0.0']}}", "it has no port"),
        ("{mode: 'peer'}", "mode must not be 'peer'"),
        ("{plugins: {rest: {}}}", "plugins are loaded by zenohd alone"),
        (
            "{transport: {link: {tls: {connect_private_key_base64: 'QQ=='}}}}",
            "write it to a file, and name that in transport.link.tls.connect_private_key",
        ),
        ("{timestamping: {enabled: {client: false}}}", "timestamping.enabled must be true"),
        ("{timestamping: {enabled: false}}", "timestamping.enabled must be true"),
    ],
)
def test_what_cannot_work_is_one_sentence(tmp_path: Path, text: str, words: str) -> None:
    path = written(tmp_path, text)
    with pytest.raises(BadZenohConfig) as error:
        read_zenoh_file(path)
    assert str(error.value).startswith(f"{path}")
    assert words in str(error.value)
    assert "\n" not in str(error.value)
    assert ".rs:" not in str(error.value)


def test_a_file_that_is_none_is_named(tmp_path: Path) -> None:
    with pytest.raises(BadZenohConfig, match=f"{tmp_path} is a folder: --zenoh-config names"):
        read_zenoh_file(tmp_path)
    with pytest.raises(BadZenohConfig, match=f"there is no file {tmp_path}/nowhere"):
        read_zenoh_file(tmp_path / "nowhere")
    with pytest.raises(BadZenohConfig, match=r"\.txt.*are supported"):
        read_zenoh_file(written(tmp_path, "{}", "zenoh.txt"))


def value(file: ZenohFile | None, mode: str, name: str) -> object:
    assert mode in ("client", "router")
    config = zenoh_config(mode, namespace="home", lease_s=2.0, file=file)  # type: ignore[arg-type]
    return json.loads(config.get_json(name))


def test_what_the_file_says_goes_before_and_what_it_leaves_out_is_filled_in(tmp_path: Path) -> None:
    text = """
    // comments and all
    {
      scouting: {gossip: {enabled: true}},
      transport: {link: {tx: {lease: 5000}}, unicast: {max_sessions: 7}},
      connect: {retry: {period_init_ms: 1000}},
    }
    """
    file = read_zenoh_file(written(tmp_path, text))
    assert value(file, "client", "scouting/gossip/enabled") is True
    assert value(file, "client", "scouting/multicast/enabled") is False
    assert value(file, "client", "transport/link/tx/lease") == 5000
    assert value(None, "client", "transport/link/tx/lease") == 2000
    assert value(file, "router", "transport/unicast/max_sessions") == 7
    assert value(file, "client", "transport/shared_memory/enabled") is False
    assert value(file, "client", "timestamping/enabled") is True
    retry = value(file, "client", "connect/retry")
    assert isinstance(retry, dict)
    assert retry["period_init_ms"] == 1000


def test_what_contradicts_the_process_is_refused(tmp_path: Path) -> None:
    file = read_zenoh_file(written(tmp_path, "{mode: 'router'}"))
    with pytest.raises(BadZenohConfig, match="mode 'router' is for `robotctl router`"):
        value(file, "client", "mode")
    file = read_zenoh_file(written(tmp_path, "{namespace: 'garden'}"))
    with pytest.raises(BadZenohConfig, match=r"contradicts the realm 'home'.* say --realm garden"):
        value(file, "client", "mode")


def test_endpoints_are_read_for_each_mode_and_files_from_the_folder(tmp_path: Path) -> None:
    text = """{
      connect: {endpoints: {
        client: ["tcp/a:1", {strategy: "oneOf", locators: ["tcp/b:2", "tcp/c:3"]}],
        router: ["tcp/d:4"],
      }},
      listen: {endpoints: ["tcp/0.0.0.0:0"]},
      scouting: {multicast: {enabled: true}},
      transport: {link: {tls: {root_ca_certificate: "ca.pem", connect_private_key: "KEY"}}},
    }"""
    key = tmp_path / "keys" / "k.pem"
    key.parent.mkdir()
    for path in (tmp_path / "ca.pem", key):
        path.touch()
    file = read_zenoh_file(written(tmp_path, text.replace("KEY", str(key))))
    assert file.connects("client") == ("tcp/a:1", "tcp/b:2", "tcp/c:3")
    assert file.connects("router") == ("tcp/d:4",)
    assert file.listens() == ("tcp/0.0.0.0:0",)
    assert file.scouts
    tls = value(file, "client", "transport/link/tls")
    assert isinstance(tls, dict)
    assert tls["root_ca_certificate"] == str(tmp_path / "ca.pem")
    assert tls["connect_private_key"] == str(key)
    bare = read_zenoh_file(written(tmp_path, "{}"))
    assert (bare.listens(), bare.connects("router"), bare.scouts) == ((), (), False)


def test_links_that_cannot_be_are_refused_before_anybody_waits_for_them(tmp_path: Path) -> None:
    only_tls = read_zenoh_file(written(tmp_path, "{transport: {link: {protocols: ['tls']}}}"))
    for mode, ends, words in (
        ("client", {"connect": ["tcp/a:1"]}, "tcp/a:1 is tcp: name the router, as tls/HOST:7447,"),
        ("router", {"listen": ["tcp/a:1"]}, "name what it listens on, as tls/0.0.0.0:7447,"),
    ):
        with pytest.raises(BadZenohConfig, match=words):
            zenoh_config(mode, file=only_tls, **ends)  # type: ignore[arg-type]
    tls = "{transport: {link: {tls: {%s: 'k.pem'}}}}"
    connects = read_zenoh_file(written(tmp_path, tls % "connect_private_key"))
    with pytest.raises(BadZenohConfig, match=rf"{tmp_path}/k.pem \(.*\) is not there"):
        zenoh_config("client", file=connects)
    listens = read_zenoh_file(written(tmp_path, tls % "listen_private_key"))
    zenoh_config("client", file=listens)
    with pytest.raises(BadZenohConfig, match="is not there"):
        zenoh_config("router", file=listens)


async def test_a_session_gets_in_by_what_its_file_says(tmp_path: Path) -> None:
    """Zenoh's own user names and passwords: nothing of them is known to this system."""
    written(tmp_path, "ana:secret\n", "users.txt")
    text = "{transport: {auth: {usrpwd: {dictionary_file: 'users.txt'}}}}"
    guarded = read_zenoh_file(written(tmp_path, text, "router.json5"))
    who = (
        "{connect: {endpoints: ['%s']}, transport: {auth: {usrpwd: {user: 'ana', password: '%s'}}}}"
    )
    endpoint = free_endpoint()
    right = written(tmp_path, who % (endpoint, "secret"), "right.json5")
    wrong = written(tmp_path, who % (endpoint, "guess"), "wrong.json5")
    async with run_router((endpoint,), file=guarded):
        async with open_session(SessionConfig((), zenoh_config=right)) as session:
            assert session.connected
            assert session.config.endpoints == (endpoint,)
        for config in (
            SessionConfig((), zenoh_config=wrong, connect_timeout_s=0.3),
            SessionConfig((endpoint,), connect_timeout_s=0.3),
        ):
            with pytest.raises(Unreachable):
                async with open_session(config):
                    pass
