"""Prompts: text files, by version; files of the same name in a user's rules folder replace them."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from string import Template

from fleet.errors import BadLlmConfig
from fleet.llm.configuration import LlmConfig

PROMPTS_DIR = Path(__file__).parent / "prompts"
MAX_CHARS = 20_000
"""A longer prompt file is taken for a mistake."""


@dataclass(frozen=True)
class Prompts:
    """The prompt texts; `version` says which they are, rules of the user included."""

    version: str
    texts: Mapping[str, str]

    def fill(self, name: str, **values: str) -> str:
        """The prompt `name` with `$placeholders` filled in.

        A value is never looked through for placeholders, so nothing in it is expanded.
        """
        house = {"house_rules": Template(self.texts["house-rules"]).safe_substitute().strip()}
        return Template(self.texts[name]).safe_substitute({**house, **values}).strip()


def load_prompts(config: LlmConfig) -> Prompts:
    """The prompts that the configuration asks for.

    Raises:
        BadLlmConfig: there is no such version, or the rules folder does not fit it.
    """
    folder = PROMPTS_DIR / config.prompts
    versions = sorted(path.name for path in PROMPTS_DIR.iterdir() if path.is_dir())
    if config.prompts not in versions:
        raise BadLlmConfig(
            f"there are no prompts {config.prompts!r}; there are {', '.join(versions)}"
        )
    texts = {path.stem: path.read_text(encoding="utf-8") for path in sorted(folder.glob("*.txt"))}
    own = {} if config.rules_dir is None else _user_prompts(Path(config.rules_dir), texts)
    if not own:
        return Prompts(config.prompts, texts)
    digest = hashlib.sha256(repr(sorted(own.items())).encode()).hexdigest()[:8]
    return Prompts(f"{config.prompts}+rules-{digest}", {**texts, **own})


def _user_prompts(folder: Path, texts: Mapping[str, str]) -> dict[str, str]:
    if not folder.is_dir():
        raise BadLlmConfig(f"the rules folder {folder} does not exist")
    own: dict[str, str] = {}
    for path in sorted(folder.glob("*.txt")):
        if path.stem not in texts:
            names = ", ".join(f"{name}.txt" for name in sorted(texts))
            raise BadLlmConfig(f"{path} replaces no prompt; those are {names}")
        try:
            text = path.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise BadLlmConfig(f"{path} cannot be read: {error}") from None
        if len(text) > MAX_CHARS:
            raise BadLlmConfig(f"{path} has {len(text)} characters; {MAX_CHARS} are allowed")
        known = {*Template(texts[path.stem]).get_identifiers(), "house_rules"}
        given = Template(text)
        if not given.is_valid() or (set(given.get_identifiers()) - known):
            wanted = ", ".join(f"${name}" for name in sorted(known))
            raise BadLlmConfig(f"{path}: placeholders are {wanted}; write $$ for a dollar sign")
        own[path.stem] = text
    return own
