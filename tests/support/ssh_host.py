"""A host that is reached over ssh: an sshd of our own, on the loopback, with keys of its own."""

from __future__ import annotations

import getpass
import os
import shutil
import socket
import subprocess
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from pathlib import Path

import pytest

from keyexpr_schema.free_ports import free_port
from tests.support.child_process import child_process
from tests.support.polling import DEADLINE_S, until

NAME = "robot-host"


@asynccontextmanager
async def ssh_host(folder: Path, path: str) -> AsyncIterator[Path]:
    """Run sshd until the end of the block; what is typed there has this PATH.

    Yields a folder with an `ssh` that knows the host by `NAME`. Skips the test where there is no
    sshd.
    """
    sshd = shutil.which("sshd", path=f"{os.environ['PATH']}:/usr/sbin:/sbin")
    ssh = shutil.which("ssh")
    if sshd is None or ssh is None:
        pytest.skip("sshd or ssh is not on the path: nothing was deployed over ssh")
    port, here = _prepared(folder, path, ssh)
    with (folder / "sshd.log").open("w") as log:
        command = (sshd, "-D", "-e", "-f", str(folder / "sshd_config"))
        async with child_process(*command, stdout=log, stderr=log):

            def listens() -> bool:
                with (
                    suppress(OSError),
                    socket.create_connection(("127.0.0.1", port), DEADLINE_S),
                ):
                    return True
                return False

            await until(listens, "sshd to listen")
            yield here


def _prepared(folder: Path, path: str, ssh: str) -> tuple[int, Path]:
    """Write keys and configuration of both ends; the port, and the folder with our `ssh`."""
    if os.geteuid() == 0:  # where nobody has started a service of the system's own
        Path("/run/sshd").mkdir(mode=0o755, exist_ok=True)
    for key in ("host", "own"):
        made = ["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", str(folder / key)]
        subprocess.run(made, check=True, timeout=DEADLINE_S)
    port = free_port()
    config = folder / "sshd_config"
    config.write_text(
        f"Port {port}\nListenAddress 127.0.0.1\nHostKey {folder / 'host'}\nPidFile none\n"
        f"AuthorizedKeysFile {folder / 'own.pub'}\nPasswordAuthentication no\nStrictModes no\n"
        f"SetEnv PATH={path}\n"
    )
    client = folder / "ssh_config"
    client.write_text(
        f"Host {NAME}\n HostName 127.0.0.1\n Port {port}\n User {getpass.getuser()}\n"
        f" IdentityFile {folder / 'own'}\n IdentitiesOnly yes\n StrictHostKeyChecking no\n"
        f" UserKnownHostsFile /dev/null\n LogLevel ERROR\n"
    )
    here = folder / "bin"
    here.mkdir()
    program = here / "ssh"
    program.write_text(f'#!/bin/sh\nexec {ssh} -F {client} "$@"\n')
    program.chmod(0o755)
    return port, here
