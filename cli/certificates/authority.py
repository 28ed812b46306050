"""`Authority`: makes the certificates by which routers and what connects to them know each other.

A folder with the authority's own key and certificate, a key and a certificate for each identity,
and a Zenoh configuration for each that uses them (`--zenoh-config`). Keys are readable by their
owner alone. Elliptic curve P-256, SHA-256, as TLS 1.3 and Zenoh's rustls support everywhere.
"""

from __future__ import annotations

import ipaddress
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import msgspec
from cryptography import x509
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import (
    Encoding,
    NoEncryption,
    PrivateFormat,
    load_pem_private_key,
)
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from cli.certificates.identity import Identity, Kind
from cli.certificates.revocation_list import write_list
from cli.certificates.zenoh_settings import with_access_control, zenoh_settings
from cli.errors import BadCertificates
from keyexpr_schema.access_control import access_control
from keyexpr_schema.decoding import decode
from keyexpr_schema.private_files import private_folder, write_private
from keyexpr_schema.transport.credentials import REVOKED_SUFFIX
from keyexpr_schema.whole_files import sync_folder

AUTHORITY_DAYS = 3650
DAYS = 365
TITLE = "RobotFleet "
"""What the name of an authority begins with; the realm comes after it."""
CLOCKS_APART = timedelta(minutes=5)
"""A certificate is valid from a little before it was made: clocks differ."""
CA, CA_KEY, ISSUED = "ca.pem", "ca.key", "issued.json"
REVOKED = str(Path(CA).with_suffix(REVOKED_SUFFIX))
ALWAYS = ("localhost", "127.0.0.1", "::1")
"""Names under which a router is reached on its own host."""


class Issued(msgspec.Struct, frozen=True):
    """A certificate that was made. Times are Unix time [s]."""

    identity: str
    serial: str
    made_s: float
    expires_s: float
    hosts: tuple[str, ...] = ()
    revoked_s: float | None = None
    replaced: bool = False
    """It is revoked because there is another one, which says nothing against this one."""

    @property
    def revoked(self) -> bool:
        """Whether nobody is to believe it any more."""
        return self.revoked_s is not None


@dataclass(frozen=True)
class Files:
    """Where a certificate, its key, and a Zenoh configuration with both are."""

    certificate: Path
    key: Path
    settings: Path


class Authority:
    """The authority in `folder`; `create` makes a new one.

    Raises:
        BadCertificates: there is none in the folder, or it cannot be read.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        try:
            self._certificate = x509.load_pem_x509_certificate((folder / CA).read_bytes())
            key = load_pem_private_key((folder / CA_KEY).read_bytes(), None)
        except FileNotFoundError:
            raise BadCertificates(
                f"there is no authority in {folder}: make one with `robotctl certs init`"
            ) from None
        except (OSError, ValueError) as error:
            raise BadCertificates(f"the authority in {folder} cannot be read: {error}") from None
        if not isinstance(key, ec.EllipticCurvePrivateKey):
            raise BadCertificates(f"{folder / CA_KEY} is no key of this program")
        self._key = key

    @classmethod
    def create(cls, folder: Path, realm: str, now: datetime | None = None) -> Authority:
        """A new authority for a realm.

        Raises:
            BadCertificates: there is one already, whose certificates would be worth nothing, or
                the folder cannot be written.
        """
        if (folder / CA_KEY).exists():
            raise BadCertificates(
                f"there is an authority in {folder} already: what it has certified would be worth "
                "nothing with a new one; move the folder away if that is meant"
            )
        now = now or datetime.now(UTC)
        key = ec.generate_private_key(ec.SECP256R1())
        name = _name(f"{TITLE}{realm}")
        certificate = (
            _builder(name, name, key.public_key(), now, AUTHORITY_DAYS)
            .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
            .add_extension(_key_usage(signs_certificates=True), critical=True)
            .add_extension(
                x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False
            )
            .sign(key, hashes.SHA256())
        )
        try:
            private_folder(folder).chmod(0o700)
            write_private(folder / CA_KEY, _private(key))
            write_private(folder / CA, certificate.public_bytes(Encoding.PEM))
        except OSError as error:
            raise BadCertificates(f"{folder} cannot be written: {error.strerror}") from None
        return cls(folder)

    @property
    def realm(self) -> str:
        """The realm that it was made for."""
        (name,) = self._certificate.subject.get_attributes_for_oid(NameOID.COMMON_NAME)
        return str(name.value).removeprefix(TITLE)

    @property
    def expires(self) -> datetime:
        """When the authority's own certificate, and so each of its, is worth nothing any more."""
        return self._certificate.not_valid_after_utc

    def issue(
        self,
        identity: Identity,
        hosts: Iterable[str] = (),
        days: int = DAYS,
        connect: Sequence[str] = (),
        listen: Sequence[str] = (),
        now: datetime | None = None,
    ) -> Files:
        """A key and a certificate for `identity`, and a Zenoh configuration with them.

        `hosts` are the names and addresses under which a router is reached. `connect` and `listen`
        are endpoints for the configuration. One that there was before is replaced, and revoked.

        Raises:
            BadCertificates: a host is none, or the folder cannot be written.
        """
        now = now or datetime.now(UTC)
        names = tuple(dict.fromkeys((*hosts, *ALWAYS))) if identity.kind is Kind.ROUTER else ()
        key = ec.generate_private_key(ec.SECP256R1())
        subject = _name(identity.common_name)
        builder = (
            _builder(subject, self._certificate.subject, key.public_key(), now, days)
            .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
            .add_extension(_key_usage(signs_certificates=False), critical=True)
            .add_extension(_purposes(identity), critical=False)
            .add_extension(
                x509.AuthorityKeyIdentifier.from_issuer_public_key(self._key.public_key()),
                critical=False,
            )
            .add_extension(
                x509.SubjectAlternativeName([_alternative(each) for each in names])
                if names
                else x509.SubjectAlternativeName([x509.DNSName(identity.common_name)]),
                critical=False,
            )
        )
        certificate = builder.sign(self._key, hashes.SHA256())
        files = self.files(identity)
        try:
            write_private(files.key, _private(key))
            write_private(files.certificate, certificate.public_bytes(Encoding.PEM))
            self._record(identity, certificate, names, now)
            settings = zenoh_settings(
                identity, self.folder / CA, files.certificate, files.key, connect, listen,
                self.access_control(now) if identity.kind is Kind.ROUTER else None,
            )  # fmt: skip
            write_private(files.settings, settings.encode())
        except OSError as error:
            raise BadCertificates(f"{self.folder} cannot be written: {error.strerror}") from None
        return files

    def files(self, identity: Identity) -> Files:
        """Where what belongs to an identity is, or would be."""
        stem = self.folder / identity.file_name
        return Files(
            certificate=stem.with_name(f"{stem.name}.pem"),
            key=stem.with_name(f"{stem.name}.key"),
            settings=stem.with_name(f"{stem.name}.json5"),
        )

    def issued(self) -> list[Issued]:
        """All that were made, the oldest first.

        Raises:
            BadCertificates: the list of them cannot be read.
        """
        path = self.folder / ISSUED
        if not path.exists():
            return []
        try:
            return list(decode(path.read_bytes(), tuple[Issued, ...]))
        except (OSError, msgspec.MsgspecError) as error:
            raise BadCertificates(f"{path} cannot be read: {error}") from None

    def access_control(self, now: datetime | None = None) -> dict[str, Any]:
        """What everybody may do whose certificate holds; see `keyexpr_schema.access_control`."""
        return access_control(self.known(now), self.realm)

    def known(self, now: datetime | None = None) -> list[str]:
        """The common names of those whose certificate holds."""
        now_s = (now or datetime.now(UTC)).timestamp()
        return [e.identity for e in self.issued() if not e.revoked and e.expires_s > now_s]

    def renew_access(self) -> list[Path]:
        """Write the access control anew into the configuration of each router; which had another.

        Raises:
            BadCertificates: one was changed by hand, so that it cannot be read as JSON, or the
                folder cannot be written.
        """
        control = self.access_control()
        changed = []
        for path in sorted(self.folder.glob(f"{Kind.ROUTER.value}-*.json5")):
            try:
                before = path.read_text(encoding="utf-8")
                after = with_access_control(before, control)
                if after != before:
                    write_private(path, after.encode())
                    changed.append(path)
            except (OSError, ValueError) as error:
                raise BadCertificates(
                    f"the access control in {path} cannot be renewed: {error}; `robotctl acl` "
                    "prints what goes into it"
                ) from None
        return changed

    def revoke(
        self, who: Sequence[Identity], now: datetime | None = None, *, replaced: bool = False
    ) -> list[Issued]:
        """Note that the certificates of all these are not to be believed, those included that
        others took the place of, and write the list of all such (`revocations`); which ones.

        Their keys are deleted here. With `replaced` only those that others took the place of.

        Raises:
            BadCertificates: one has none of these; then nobody's are revoked. Or the folder cannot
                be written.
        """
        now = now or datetime.now(UTC)
        now_s = now.timestamp()
        issued = self.issued()
        holding = [each for each in issued if each.replaced or not (replaced or each.revoked)]
        known = sorted({e.identity for e in issued if (e.replaced if replaced else not e.revoked)})
        which = "that another took the place of" if replaced else "that holds"
        for identity in who:
            if str(identity) not in known:
                raise BadCertificates(
                    f"{identity} has no certificate {which}; those that have: "
                    f"{', '.join(known) or 'nobody'}"
                )
        names = set(map(str, who))
        gone = [each for each in holding if each.identity in names]
        issued = [
            msgspec.structs.replace(each, revoked_s=now_s, replaced=False) if each in gone else each
            for each in issued
        ]
        taken_back = [
            (int(each.serial, 16), each.revoked_s)
            for each in issued
            if each.revoked_s is not None and not each.replaced and each.expires_s > now_s
        ]
        try:
            write_list(self.revocations, self._certificate.subject, self._key, taken_back, now)
            self._save(issued)
            for identity in () if replaced else who:
                self.files(identity).key.unlink(missing_ok=True)
            sync_folder(self.folder)
        except OSError as error:
            raise BadCertificates(f"{self.folder} cannot be written: {error.strerror}") from None
        return gone

    @property
    def revocations(self) -> Path:
        """Where the list of what was taken back is, once something was."""
        return self.folder / REVOKED

    def _record(
        self,
        identity: Identity,
        certificate: x509.Certificate,
        hosts: tuple[str, ...],
        now: datetime,
    ) -> None:
        before = (
            msgspec.structs.replace(each, revoked_s=now.timestamp(), replaced=True)
            if each.identity == str(identity) and not each.revoked
            else each
            for each in self.issued()
        )
        new = Issued(
            identity=str(identity),
            serial=f"{certificate.serial_number:x}",
            made_s=now.timestamp(),
            expires_s=certificate.not_valid_after_utc.timestamp(),
            hosts=hosts,
        )
        self._save((*before, new))

    def _save(self, issued: Iterable[Issued]) -> None:
        text = msgspec.json.format(msgspec.json.encode(list(issued)), indent=2)
        write_private(self.folder / ISSUED, text)


def _builder(
    subject: x509.Name,
    issuer: x509.Name,
    key: ec.EllipticCurvePublicKey,
    now: datetime,
    days: int,
) -> x509.CertificateBuilder:
    return (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(issuer)
        .public_key(key)
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - CLOCKS_APART)
        .not_valid_after(now + timedelta(days=days))
    )


def _name(common_name: str) -> x509.Name:
    return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, common_name)])


def _key_usage(*, signs_certificates: bool) -> x509.KeyUsage:
    return x509.KeyUsage(
        digital_signature=True,
        content_commitment=False,
        key_encipherment=False,
        data_encipherment=False,
        key_agreement=False,
        key_cert_sign=signs_certificates,
        crl_sign=signs_certificates,
        encipher_only=False,
        decipher_only=False,
    )


def _purposes(identity: Identity) -> x509.ExtendedKeyUsage:
    """A router is connected to, and connects to other routers."""
    purposes = [ExtendedKeyUsageOID.CLIENT_AUTH]
    if identity.kind is Kind.ROUTER:
        purposes.insert(0, ExtendedKeyUsageOID.SERVER_AUTH)
    return x509.ExtendedKeyUsage(purposes)


def _alternative(host: str) -> x509.GeneralName:
    try:
        return x509.IPAddress(ipaddress.ip_address(host))
    except ValueError:
        pass
    try:
        return x509.DNSName(host)
    except ValueError:
        raise BadCertificates(f"{host!r} is neither a host's name nor an address") from None


def _private(key: ec.EllipticCurvePrivateKey) -> bytes:
    return key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())
