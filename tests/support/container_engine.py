"""An engine of a few lines, for what is asked of one where there is none: it keeps names in files.

Containers themselves are run by Podman, in `tests/e2e/test_containers.py`.
"""

from __future__ import annotations

import shutil
from pathlib import Path

_SCRIPT = """#!/bin/sh
# What it was told, a word a line; then what Podman would say and how it would end.
here={folder}
printf '%s\\n' "$@" > "$here/told"
case "$1" in
run)
    name=; image=
    while [ $# -gt 0 ]; do
        case "$1" in --name) name=$2 ;; nowhere/*) image=$1 ;; esac
        shift
    done
    [ -z "$image" ] || {{ echo "Trying to pull $image"; echo "Error: no route" >&2; exit 125; }}
    echo began > "$here/$name.log"; echo 0123abcd ;;
image) [ "$5" != nowhere/x ] || {{ echo "Error: $5: image not known" >&2; exit 125; }} ;;
container) [ -e "$here/$5.log" ] || {{ echo "Error: no such container $5" >&2; exit 125; }} ;;
logs) shift 3; cat "$here/$1.log" ;;
stop) [ -e "$here/$4.log" ] || {{ echo "Error: no such container $4" >&2; exit 125; }} ;;
rm) rm "$here/$2.log" ;;
esac
"""


def container_engine(folder: Path) -> Path:
    """A program `podman` in `folder`, which serves as a PATH: its containers are files there."""
    for needed in ("cat", "rm"):
        program = shutil.which(needed)
        assert program is not None
        (folder / needed).symlink_to(program)
    engine = folder / "podman"
    engine.write_text(_SCRIPT.format(folder=folder))
    engine.chmod(0o755)
    return engine
