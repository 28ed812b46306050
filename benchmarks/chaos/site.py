"""Where the fleet of the chaos run is: three hosts with cables, small disks, and clocks to set."""

from __future__ import annotations

import os
import shutil
import signal
import struct
import subprocess
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from ctypes import CDLL, get_errno
from pathlib import Path

from benchmarks.chaos.power import compiled
from cli.processes.child_processes import ChildProcesses, free_endpoint
from cli.processes.composition import PLANNER, ROUTER, SIM
from tests.support.hosts import Host, hosts, why_not

REALM = "chaos"
DISK = "24m"
BALLAST = "fills-the-disk"
_CLONE_NEWNET, _CLONE_NEWNS = 0x40000000, 0x00020000


class Site:
    """The router, the world and whoever looks on are on one host, the planner on another, the
    workers on a third. What cannot be had here is in `lacks`, in words."""

    def __init__(self, folder: Path, made: Sequence[Host], lacks: dict[str, str]) -> None:
        self.folder, self.lacks = folder, lacks
        self.hosts = {host.name: host for host in made}
        self.clocks = folder / "clocks"
        self.clocks.mkdir()
        self.syncs = folder / "syncs"
        """What each process has had on its disk; see `benchmarks.chaos.power`."""
        self.syncs.mkdir()
        self._shifted, self._noted = folder / "shifted_clock.so", folder / "noted_syncs.so"
        for kind, library in (("clock", self._shifted), ("power", self._noted)):
            if (why := compiled(library)) is not None:
                lacks[kind] = why
        address = self.hosts["site"].address if self.hosts else "127.0.0.1"
        self.endpoint = f"tcp/{address}:{free_endpoint().rpartition(':')[2]}"

    def host_of(self, process: str) -> Host | None:
        """Where a process runs."""
        name = "office" if process == PLANNER else "site" if process in (ROUTER, SIM) else "robots"
        return self.hosts.get(name)

    def surroundings(self, process: str) -> tuple[tuple[str, ...], dict[str, str]]:
        """What a process is run by, and with what in its environment."""
        host = self.host_of(process)
        before = () if host is None else ("ip", "netns", "exec", host.namespace)
        loaded, environment = [], {}
        if "power" not in self.lacks:
            loaded.append(str(self._noted))
            environment["CHAOS_SYNCS"] = str(self.syncs)
        if "clock" not in self.lacks and process not in (ROUTER, SIM):
            self.set_clock(process, 0.0)
            loaded.append(str(self._shifted))
            environment["CHAOS_CLOCK"] = str(self.clocks / process)
        if loaded:
            environment["LD_PRELOAD"] = ":".join(loaded)
        return before, environment

    def set_clock(self, process: str, ahead_s: float) -> None:
        """From now on the clock of the day of a process is so far ahead."""
        clock = self.clocks / process
        with clock.open("r+b" if clock.exists() else "w+b", buffering=0) as file:
            file.write(struct.pack("d", ahead_s))  # mapped by the process

    def data(self, process: str) -> Path:
        """The disk that a process has its data on."""
        return self.folder / "data" / process

    def fill(self, process: str) -> None:
        """Leave no room on it."""
        with (self.data(process) / BALLAST).open("wb", buffering=0) as file, suppress(OSError):
            while file.write(bytes(4096)):
                pass

    def free(self, process: str) -> None:
        """Make room again."""
        (self.data(process) / BALLAST).unlink(missing_ok=True)

    def small_disks(self, stack: ExitStack, *processes: str) -> None:
        """Give each process a disk of its own."""
        for process in processes:
            folder = self.data(process)
            folder.mkdir(parents=True)
            mount = ["mount", "-t", "tmpfs", "-o", f"size={DISK}", "tmpfs", str(folder)]
            done = subprocess.run(mount, capture_output=True, text=True, check=False)
            if done.returncode:
                self.lacks["disk"] = f"no file system can be mounted: {done.stderr.strip()}"
                return
            stack.callback(subprocess.run, ["umount", "-l", str(folder)], check=False)


class SiteProcesses(ChildProcesses):
    """The processes of a fleet, each on its host."""

    def __init__(self, site: Site) -> None:
        super().__init__(site.endpoint, REALM, site.folder)
        self.site = site

    def surroundings(self, name: str) -> tuple[Sequence[str], Mapping[str, str]]:
        """See `Site.surroundings`."""
        return self.site.surroundings(name)

    def freeze(self, name: str, frozen: bool) -> None:
        """Stop a process where it is, or let it go on."""
        if (pid := self.pid(name)) is not None:
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGSTOP if frozen else signal.SIGCONT)


@contextmanager
def site(folder: Path, *with_disks: str) -> Iterator[Site]:
    """Three hosts and small disks, as far as they can be had; this process is on the host `site`
    from now on, for good, since its threads are."""
    with ExitStack() as stack:
        lacks = {} if (why := why_not()) is None else {"cut": why}
        if not lacks:
            _here(_CLONE_NEWNS)
        names = ("site", "office", "robots") if not lacks else ()
        home = folder / "hosts"
        home.mkdir()
        made = stack.enter_context(hosts(home, *names)) if names else ()
        place = Site(folder, made, lacks)
        if made:
            with Path(f"/run/netns/{made[0].namespace}").open() as namespace:
                _check(CDLL(None, use_errno=True).setns(namespace.fileno(), _CLONE_NEWNET))
            place.small_disks(stack, *with_disks)
        else:
            lacks["disk"] = lacks["cut"]
        try:
            yield place
        finally:
            shutil.copytree(place.folder / "data", place.folder / "left", dirs_exist_ok=True)


def _here(flags: int) -> None:
    """In mounts of our own, which nobody else sees."""
    _check(CDLL(None, use_errno=True).unshare(flags))
    subprocess.run(["mount", "--make-rprivate", "/"], check=True, capture_output=True)


def _check(code: int) -> None:
    if code:
        raise OSError(get_errno(), os.strerror(get_errno()))
