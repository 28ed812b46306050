"""A Zenoh configuration of the user's own, as Zenoh reads it (JSON5 or YAML).

What the system needs is checked when the file is read, and filled in where the file does not say
it; all else is the user's: TLS, QUIC, authentication, gossip, access control, downsampling.
"""

from __future__ import annotations

import itertools
import json
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import zenoh

from keyexpr_schema.endpoints import check_endpoints
from keyexpr_schema.errors import BadEndpoint, BadZenohConfig

Mode = Literal["client", "router"]

_FILES = (
    "transport/link/tls/root_ca_certificate",
    "transport/link/tls/listen_private_key",
    "transport/link/tls/listen_certificate",
    "transport/link/tls/connect_private_key",
    "transport/link/tls/connect_certificate",
    "transport/auth/usrpwd/dictionary_file",
    "transport/auth/pubkey/public_key_file",
    "transport/auth/pubkey/private_key_file",
    "transport/auth/pubkey/known_keys_file",
)
"""Where a configuration names files, which are relative to its own folder."""
_LISTENS = "transport/link/tls/listen_"
"""Files that a router alone needs; others of its host may not be allowed to read them."""


@dataclass(frozen=True, eq=False)
class ZenohFile:
    """A configuration file that was read: `text` is JSON, with the files that it names absolute."""

    path: Path
    text: str

    def config(self) -> zenoh.Config:
        """A configuration of one's own to change."""
        return zenoh.Config.from_json5(self.text)

    def connects(self, mode: Mode) -> tuple[str, ...]:
        """The routers to connect to that the file names for `mode`."""
        return self._endpoints("connect", mode)

    def listens(self) -> tuple[str, ...]:
        """What the file has a router listen on; empty: it does not say."""
        said = said_in(self.config(), "listen/endpoints")
        return () if said is None else self._endpoints("listen", "router")

    @property
    def lets_all_do_all(self) -> bool:
        """Whether a router asks for certificates, and gives everybody who has one everything."""
        config = self.config()
        asks = said_in(config, "transport/link/tls/enable_mtls") is True
        return asks and _value(config, "access_control/enabled") is not True

    @property
    def scouts(self) -> bool:
        """Whether a client finds its router by multicast where the file names none."""
        return _for_mode(_value(self.config(), "scouting/multicast/enabled"), "client") is True

    def _endpoints(self, which: str, mode: Mode) -> tuple[str, ...]:
        found = _for_mode(_value(self.config(), f"{which}/endpoints"), mode) or ()
        listed = ([each] if isinstance(each, str) else each["locators"] for each in found)
        return tuple(itertools.chain.from_iterable(listed))


def read_zenoh_file(path: Path) -> ZenohFile:
    """A Zenoh configuration file, checked for what no process of the system could work with.

    Raises:
        BadZenohConfig: it cannot be read or used; one sentence says where and why, and what would
            be right.
    """
    if not path.is_file():
        what = f"{path} is a folder" if path.is_dir() else f"there is no file {path}"
        raise BadZenohConfig(f"{what}: --zenoh-config names a Zenoh configuration")
    try:
        config = zenoh.Config.from_file(str(path))
    except zenoh.ZError as error:
        raise BadZenohConfig(f"{path}{_reason(error)}") from None
    _check(config, path)
    for name in _FILES:
        if isinstance(file := _value(config, name), str):
            config.insert_json5(name, json.dumps(str(path.absolute().parent / file)))
    found = ZenohFile(path, str(config))
    try:
        check_endpoints((*found.connects("client"), *found.connects("router")))
        check_endpoints(found.listens(), listens=True)
    except BadEndpoint as error:
        raise BadZenohConfig(f"{path}: {error}") from None
    return found


def said_in(config: zenoh.Config, name: str) -> Any:
    """What a configuration says otherwise than Zenoh by itself at `name`, such as
    `scouting/gossip/enabled`; `None`: nothing."""
    value = _value(config, name)
    return None if value == _value(zenoh.Config(), name) else value


def _check(config: zenoh.Config, path: Path) -> None:
    mode = _value(config, "mode")
    if mode == "peer":
        raise BadZenohConfig(
            f"{path}: mode must not be 'peer': the processes of a fleet are clients of a router; "
            "leave it out"
        )
    if _value(config, "plugins"):
        raise BadZenohConfig(
            f"{path}: plugins are loaded by zenohd alone; leave them out, or start zenohd with it"
        )
    for name in _FILES:
        # Zenoh keeps these to itself: who is connected by them could not be told.
        if name.startswith("transport/link/tls/") and _value(config, f"{name}_base64"):
            said = name.replace("/", ".")
            raise BadZenohConfig(
                f"{path}: {said}_base64 is not read here: write it to a file, and name that in "
                f"{said}"
            )
    timestamps = _value(config, "timestamping/enabled")
    modes: tuple[Mode, ...] = ("client", "router")
    for each in modes:
        if _for_mode(timestamps, each) is False:
            raise BadZenohConfig(
                f"{path}: timestamping.enabled must be true: the latest value of a key wins by it"
            )


def check_mode(file: ZenohFile, mode: Mode) -> None:
    """That a configuration is for a process that is a `mode`.

    Raises:
        BadZenohConfig: it says that it is for another.
    """
    said = _value(file.config(), "mode")
    if said is not None and said != mode:
        what = "`robotctl router`" if said == "router" else "what connects to a router"
        raise BadZenohConfig(
            f"{file.path}: mode {said!r} is for {what}, and this is a {mode}; leave mode out if "
            "the file is for both"
        )


def check_links(file: ZenohFile, mode: Mode, endpoints: Sequence[str]) -> None:
    """That a `mode` can have links over these endpoints: the files for them are there, and their
    protocols are let through.

    Raises:
        BadZenohConfig: it cannot.
    """
    config = file.config()
    for name in _FILES:
        if mode == "router" or not name.startswith(_LISTENS):
            _check_file(config, file.path, name)
    protocols = _value(config, "transport/link/protocols") or ()
    for endpoint in endpoints:
        protocol = endpoint.partition("/")[0]
        if protocols and protocol not in protocols:
            where = (
                f"what it listens on, as {protocols[0]}/0.0.0.0:7447, with --listen or in listen"
                if mode == "router"
                else f"the router, as {protocols[0]}/HOST:7447, with --router or in connect"
            )
            raise BadZenohConfig(
                f"{file.path}: links go over {' and '.join(protocols)} alone "
                f"(transport.link.protocols), and {endpoint} is {protocol}: name {where}.endpoints"
            )


def check_namespace(file: ZenohFile, realm: str) -> None:
    """That a configuration does not name another realm than `realm`.

    Raises:
        BadZenohConfig: it does; the realm is what the system uses a session's namespace for.
    """
    said = _value(file.config(), "namespace")
    if said not in (None, realm):
        raise BadZenohConfig(
            f"{file.path}: namespace {said!r} contradicts the realm {realm!r}; leave it out, or "
            f"say --realm {said}"
        )


def _check_file(config: zenoh.Config, path: Path, name: str) -> None:
    file = _value(config, name)
    if not isinstance(file, str) or os.access(file, os.R_OK):
        return
    wrong = "may not be read by this user" if Path(file).exists() else "is not there"
    raise BadZenohConfig(f"{path}: {file} ({name.replace('/', '.')}) {wrong}")


def _value(config: zenoh.Config, name: str) -> Any:
    try:
        return json.loads(config.get_json(name))
    except zenoh.ZError:
        return None


def _for_mode(value: Any, mode: Mode) -> Any:
    """The part of a value that is for `mode`, where it says so for each mode."""
    return value.get(mode) if isinstance(value, dict) else value


def _reason(error: zenoh.ZError) -> str:
    """`, line 3: …` or `: …`: what Zenoh says of a file, without the place in Zenoh's code."""
    said = " ".join(re.sub(r" at /\S+\.rs:\d+\.?", "", str(error)).split())
    line = re.search(r"line: (\d+)|--> (\d+):", said)
    words = re.search(r'(?:msg: |Error\()"(.*?)"(?:, l|$)', said) or re.search(r"= (.*)", said)
    where = f", line {next(filter(None, line.groups()))}" if line else ""
    return f"{where}: {words.group(1) if words else said}"
