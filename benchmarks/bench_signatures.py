"""What a signature costs who says something, and who judges it; what it costs to refuse garbage.

For a goal of 60 characters, in CPU time. Each row is the least and the median of rounds [µs], so
that whoever else works on the machine shows.
"""

from __future__ import annotations

import argparse
import os
import statistics
import tempfile
import time
from collections.abc import Callable, Iterator
from itertools import count, islice
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives.serialization import Encoding, load_pem_private_key

from cli.certificates.authority import Authority as Office
from cli.certificates.authority import Files
from cli.certificates.identity import Identity
from keyexpr_schema.keyspace import GOAL_SPEC
from keyexpr_schema.payloads.goals import Goal, GoalAddress
from keyexpr_schema.transport.attachments import Attachment, Signature
from keyexpr_schema.transport.samples import Encoded, encoding_of
from keyexpr_schema.transport.signatures import Authority, Signer
from keyexpr_schema.transport.stamps import stamp_of, text_of_stamp, ticks_of_time

GOAL = Goal(goal="g1", text="Bring the first cup to the hallway, then the second.", said_by="ana")
VALUE = Encoded(
    f"home/{GOAL_SPEC.build(GoalAddress('g1'))}", GOAL_SPEC.encode(GOAL), encoding_of(GOAL_SPEC)
)
STAMP = stamp_of(ticks_of_time(time.time()), 7)


def der(files: Files) -> bytes:
    """The certificate in a file, in DER."""
    found = x509.load_pem_x509_certificate(files.certificate.read_bytes())
    return found.public_bytes(Encoding.DER)


def signer_of(files: Files) -> Signer:
    """Who signs with a key."""
    key = load_pem_private_key(files.key.read_bytes(), None)
    return Signer(der(files), key)


def garbage(own: bytes, foreign: bytes) -> dict[str, Callable[[], Iterator[bytes]]]:
    """Certificates that nobody believes, by what they are; each is another one."""

    def changed(certificate: bytes, at: int) -> Iterator[bytes]:
        for number in count(1):
            made = bytearray(certificate)
            made[at - 3 : at] = (number % 2**24).to_bytes(3, "big")
            yield bytes(made)

    return {
        "random bytes": lambda: iter(lambda: os.urandom(600), b""),
        "random bytes, 12 kB": lambda: iter(lambda: os.urandom(12_000), b""),
        "the same again and again": lambda: iter(lambda: foreign, b""),
        "another authority's, each another": lambda: changed(foreign, len(foreign)),
        "a true one, changed in its signature": lambda: changed(own, len(own)),
        "a true one, changed in its text": lambda: changed(own, len(own) // 2),
    }


def measured(what: Callable[[], object], rounds: int, times: int) -> str:
    """The least and the median of rounds, of one of so many times [µs]."""
    found = []
    for _ in range(rounds):
        begun_s = time.process_time()
        for _ in range(times):
            what()
        found.append((time.process_time() - begun_s) / times * 1e6)
    return f"{min(found):.0f}, {statistics.median(found):.0f}"


def main() -> None:
    """Measure, and print a table."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--rounds", type=int, default=15)
    options.add_argument("--times", type=int, default=200)
    given = options.parse_args()

    def row(name: str, what: Callable[[], object]) -> None:
        print(f"| {name} | {measured(what, given.rounds, given.times)} |", flush=True)

    with tempfile.TemporaryDirectory() as folder:
        office, others = (Office.create(Path(folder) / name, "home") for name in ("ours", "others"))
        ana = Identity.parse("operator.ana")
        files, foreign = office.issue(ana), others.issue(ana)
        roots = [x509.load_pem_x509_certificate((office.folder / "ca.pem").read_bytes())]
        signer, authority = signer_of(files), Authority(roots)
        text = signer.attachment(VALUE.keyexpr, text_of_stamp(STAMP), VALUE.data) or ""
        attached = text.encode()
        signature = Attachment.read(attached).signature
        assert signature is not None
        assert authority.objection(VALUE, STAMP, Attachment.read(attached)) is None

        print("| what | least, median [µs] |\n| --- | --- |")
        row("sign", lambda: signer.attachment(VALUE.keyexpr, text_of_stamp(STAMP), VALUE.data))
        row("judge", lambda: authority.objection(VALUE, STAMP, Attachment.read(attached)))
        for name, kinds in garbage(der(files), der(foreign)).items():
            odd = [
                (Attachment(None, Signature(signature.value, each)).text() or "").encode()
                for each in islice(kinds(), given.rounds * given.times)
            ]
            made = iter(odd)

            def refused(made: Iterator[bytes] = made) -> None:
                assert authority.objection(VALUE, STAMP, Attachment.read(next(made)))

            row(f"refuse {name}", refused)


if __name__ == "__main__":
    main()
