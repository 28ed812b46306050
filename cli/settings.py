"""Where robotctl finds its fleet: flag, then environment, then file, then default."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cli.errors import BadSettings

DEFAULT_ROUTER = "tcp/127.0.0.1:7447"
DEFAULT_REALM = "robotfleet"
_ENDPOINT = re.compile(r"^[a-z][a-z0-9_]*/\S+$")
_REALM = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,62}", re.ASCII)
_FIELDS = ("router", "realm")


@dataclass(frozen=True)
class Settings:
    """What every command needs: `routers` are Zenoh endpoints, `realm` the session namespace."""

    routers: tuple[str, ...] = (DEFAULT_ROUTER,)
    realm: str = DEFAULT_REALM
    json: bool = False


def load_settings(
    routers: list[str] | None,
    realm: str | None,
    json: bool,
    environ: Mapping[str, str] = os.environ,
    cwd: Path | None = None,
) -> Settings:
    """Settings by precedence: flags (`None`: not given), environment, file, default.

    Raises:
        BadSettings: a value is not an endpoint or a realm, or a file is not readable; the message
            names where the value came from.
    """
    path = config_file(environ, cwd)
    told = _read(path) if path else {}
    chosen_routers, where = _choose(
        routers or None, environ.get("ROBOTFLEET_ROUTER"), told.get("router"), path, "--router"
    )
    chosen_realm, realm_where = _choose(
        realm, environ.get("ROBOTFLEET_REALM"), told.get("realm"), path, "--realm"
    )
    return Settings(
        routers=_endpoints(chosen_routers, where) or (DEFAULT_ROUTER,),
        realm=_realm(chosen_realm, realm_where),
        json=json,
    )


def config_file(environ: Mapping[str, str], cwd: Path | None = None) -> Path | None:
    """The configuration file in force, if there is one.

    Raises:
        BadSettings: `ROBOTFLEET_CONFIG` names a file that does not exist.
    """
    named = environ.get("ROBOTFLEET_CONFIG")
    if named:
        path = Path(named).expanduser()
        if not path.is_file():
            raise BadSettings(f"ROBOTFLEET_CONFIG names {named!r}, which is not a file")
        return path
    home = environ.get("HOME")
    candidates = [(cwd or Path.cwd()) / "robotctl.yaml"]
    if home:
        candidates.append(Path(home) / ".config" / "robotfleet" / "robotctl.yaml")
    return next((path for path in candidates if path.is_file()), None)


def _read(path: Path) -> dict[str, Any]:
    import yaml

    try:
        told = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise BadSettings(f"cannot read {path}: {error}") from None
    except yaml.YAMLError as error:
        raise BadSettings(f"{path} is not YAML: {one_line(error)}") from None
    if told is None:
        return {}
    if not isinstance(told, dict):
        raise BadSettings(f"{path} must hold fields such as 'router: {DEFAULT_ROUTER}'")
    for name in told:
        if name not in _FIELDS:
            raise BadSettings(f"{path} has a field {name!r}; valid are: {', '.join(_FIELDS)}")
    return told


def _choose(
    flag: object, env: str | None, told: object, path: Path | None, name: str
) -> tuple[object, str]:
    if flag is not None:
        return flag, name
    if env:
        return env, f"ROBOTFLEET_{name.removeprefix('--').upper()}"
    return told, str(path)


def _endpoints(value: object, where: str) -> tuple[str, ...]:
    if value is None:
        return ()
    entries = value.replace(",", " ").split() if isinstance(value, str) else value
    if not isinstance(entries, list):
        raise BadSettings(f"{where}: router must be an endpoint or a list of endpoints")
    for entry in entries:
        if not isinstance(entry, str) or not _ENDPOINT.match(entry):
            raise BadSettings(
                f"{where}: {entry!r} is not a Zenoh endpoint; they look like {DEFAULT_ROUTER!r}"
            )
    return tuple(entries)


def _realm(value: object, where: str) -> str:
    if value is None:
        return DEFAULT_REALM
    if not isinstance(value, str) or not _REALM.fullmatch(value):
        raise BadSettings(
            f"{where}: {value!r} is not a realm; use 1 to 63 ASCII letters, digits, '_', '.' "
            "or '-', starting with a letter or a digit"
        )
    return value


def one_line(error: object) -> str:
    """The text of an error on one line."""
    return " ".join(str(error).split())
