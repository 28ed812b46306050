"""The certificate authority of a fleet: what it makes, and what it refuses."""

from __future__ import annotations

import stat
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import Encoding, load_pem_private_key
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from cli.certificates.authority import Authority
from cli.certificates.fleet_certificates import FleetCertificates
from cli.certificates.identity import MAIN, Identity, Kind
from cli.certificates.revocation_list import read_lists
from cli.errors import BadArgument, BadCertificates
from keyexpr_schema.transport.certificate_dates import out_of_date
from keyexpr_schema.transport.zenoh_file import read_zenoh_file
from tests.support.robotctl import Robotctl

HSR, ROUTER = Identity(Kind.ROBOT, "hsr"), Identity(Kind.ROUTER, MAIN)
NOW = datetime(2026, 11, 29, 12, 0, tzinfo=UTC)


def read(path: Path) -> x509.Certificate:
    return x509.load_pem_x509_certificate(path.read_bytes())


def test_a_certificate_says_who_it_is_of_and_the_authority_vouches_for_it(tmp_path: Path) -> None:
    authority = Authority.create(tmp_path / "certs", "home", NOW)
    files = authority.issue(HSR, days=30, connect=("tls/router:7447",), now=NOW)
    found, vouching = read(files.certificate), read(tmp_path / "certs" / "ca.pem")
    (name,) = found.subject.get_attributes_for_oid(NameOID.COMMON_NAME)
    assert name.value == "robot.hsr"
    found.verify_directly_issued_by(vouching)
    assert found.not_valid_after_utc == NOW + timedelta(days=30)
    assert found.not_valid_before_utc < NOW  # clocks differ
    purposes = found.extensions.get_extension_for_class(x509.ExtendedKeyUsage).value
    assert list(purposes) == [ExtendedKeyUsageOID.CLIENT_AUTH]
    assert not found.extensions.get_extension_for_class(x509.BasicConstraints).value.ca
    assert isinstance(found.public_key(), ec.EllipticCurvePublicKey)
    settings = read_zenoh_file(files.settings)
    assert settings.connects("client") == ("tls/router:7447",)
    assert str(files.key) in settings.text


def test_who_was_not_let_in_hears_that_its_certificate_is_out_of_date(tmp_path: Path) -> None:
    folder = tmp_path / "certs"
    made = Authority.create(folder, "home", NOW).issue(HSR, days=30, now=NOW)
    file = read_zenoh_file(made.settings)
    assert out_of_date(file, NOW) is None
    late = out_of_date(file, NOW + timedelta(days=31))
    assert late is not None
    assert late.startswith(f"{folder}/robot-hsr.pem has expired on ")
    early = out_of_date(file, NOW - timedelta(days=1))
    assert early is not None
    assert "by the clock of this host" in early


def test_a_router_is_known_by_its_hosts_and_on_its_own(tmp_path: Path) -> None:
    authority = Authority.create(tmp_path, "home", NOW)
    files = authority.issue(ROUTER, hosts=("hall.example", "10.0.0.7"), now=NOW)
    names = read(files.certificate).extensions.get_extension_for_class(x509.SubjectAlternativeName)
    assert names.value.get_values_for_type(x509.DNSName) == ["hall.example", "localhost"]
    addresses = names.value.get_values_for_type(x509.IPAddress)
    assert [str(each) for each in addresses] == ["10.0.0.7", "127.0.0.1", "::1"]
    with pytest.raises(BadCertificates, match="'hallé' is neither a host's name nor an address"):
        authority.issue(ROUTER, hosts=("hallé",))


def test_keys_are_for_their_owner_alone(tmp_path: Path) -> None:
    folder = tmp_path / "certs"
    authority = Authority.create(folder, "home")
    key = authority.issue(HSR).key
    for path in (folder / "ca.key", key, folder / "issued.json"):
        assert stat.S_IMODE(path.stat().st_mode) == 0o600, path
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700


def test_a_second_authority_does_not_take_the_place_of_the_first(tmp_path: Path) -> None:
    Authority.create(tmp_path, "home")
    with pytest.raises(BadCertificates, match=r"there is an authority in .* already"):
        Authority.create(tmp_path, "home")
    with pytest.raises(BadCertificates, match=r"there is no authority in .*robotctl certs init"):
        Authority(tmp_path / "nowhere")
    (tmp_path / "ca.key").write_text("nonsense")
    with pytest.raises(BadCertificates, match="cannot be read"):
        Authority(tmp_path)


def test_who_is_certified_anew_or_revoked_has_no_other_that_holds(tmp_path: Path) -> None:
    authority = Authority.create(tmp_path, "home")
    authority.issue(HSR)
    files = authority.issue(HSR)
    held = [each for each in authority.issued() if not each.revoked]
    assert (len(authority.issued()), [each.identity for each in held]) == (2, ["robot.hsr"])
    gone = authority.revoke([HSR])
    assert [each.serial for each in gone] == [each.serial for each in authority.issued()]
    assert gone[-1].serial == held[0].serial
    assert not files.key.exists()
    with pytest.raises(BadCertificates, match=r"robot\.hsr has no certificate.*that have: nobody"):
        authority.revoke([HSR])
    # Nobody's are, where one name is wrong; and a list that has no number is no bar.
    kept = authority.issue(HSR).key
    with pytest.raises(BadCertificates, match=r"router\.main has no certificate that holds"):
        authority.revoke([HSR, ROUTER])
    assert kept.exists()
    assert not authority.issued()[-1].revoked
    _write_list_without_number(tmp_path)
    assert [each.identity for each in authority.revoke([HSR, HSR])] == ["robot.hsr"]
    (tmp_path / "ca.crl").write_text("nothing of the kind")
    authority.issue(HSR)
    with pytest.raises(BadCertificates, match=r"ca\.crl cannot be read: .*; move it away"):
        authority.revoke([HSR])
    assert not authority.issued()[-1].revoked
    (tmp_path / "issued.json").write_text("{")
    with pytest.raises(BadCertificates, match=r"issued\.json cannot be read"):
        authority.issued()


def test_of_a_certificate_that_was_replaced_the_later_one_may_hold(tmp_path: Path) -> None:
    authority = Authority.create(tmp_path, "home")
    authority.issue(HSR)
    with pytest.raises(BadCertificates, match=r"robot\.hsr has no certificate that another took"):
        authority.revoke([HSR], replaced=True)
    key = authority.issue(HSR).key
    before, after = authority.issued()
    assert [each.serial for each in authority.revoke([HSR], replaced=True)] == [before.serial]
    assert authority.issued()[1] == after
    assert authority.known() == ["robot.hsr"]
    assert key.exists()
    (listed,) = read_lists(tmp_path / "ca.crl")
    assert [f"{each.serial_number:x}" for each in listed] == [before.serial]
    with pytest.raises(BadCertificates, match="those that have: nobody"):
        authority.revoke([HSR], replaced=True)


def _write_list_without_number(folder: Path) -> None:
    """As the authority, by another program."""
    issuer = x509.load_pem_x509_certificate((folder / "ca.pem").read_bytes()).subject
    key = load_pem_private_key((folder / "ca.key").read_bytes(), None)
    assert isinstance(key, ec.EllipticCurvePrivateKey)
    now = datetime.now(UTC)
    list_ = x509.CertificateRevocationListBuilder(issuer, now, now + timedelta(days=1))
    der = list_.sign(key, hashes.SHA256()).public_bytes(Encoding.DER)
    (folder / "ca.crl").write_bytes(der)


@pytest.mark.parametrize("text", ["hsr", "robot.", "robot.a/b", "planner.two", "king.arthur"])
def test_who_cannot_have_one(text: str) -> None:
    with pytest.raises(BadArgument):
        Identity.parse(text)


def test_names_are_read_as_they_are_written() -> None:
    for text in ("robot.hsr", "operator.ana", "planner", "router.floor-1", "workers"):
        assert str(Identity.parse(text)) == text
    assert Identity.parse("router") == ROUTER


def test_a_fleet_is_certified_once_and_again_before_that_ends(tmp_path: Path) -> None:
    made = FleetCertificates(tmp_path, "home", "ana")
    assert made.operator.name == "operator-ana.json5"
    assert made.admit(["hsr"])  # a router that runs knows nothing of it
    assert set(made.processes) == {"router", "planner", "record", "sim", "worker-hsr"}
    authority = Authority(tmp_path)
    count = len(authority.issued())
    again = FleetCertificates(tmp_path, "home", "ana")
    assert not again.admit(["hsr"])
    assert again.processes == made.processes
    assert len(authority.issued()) == count
    authority.issue(Identity(Kind.PLANNER), days=20)
    FleetCertificates(tmp_path, "home", "ana")
    assert len(authority.issued()) == count + 2


def test_what_one_may_do_is_shown_and_whether_anybody_has_that_certificate(tmp_path: Path) -> None:
    robotctl = Robotctl("tcp/127.0.0.1:1", tmp_path)
    certs = ("--dir", str(tmp_path / "certs"))
    nowhere = robotctl("acl", "robot.hsr", *certs)
    assert nowhere.code == 0
    assert "whether robot.hsr has a certificate is not known here, since there is no" in nowhere.err
    Authority.create(tmp_path / "certs", "home").issue(Identity.parse("robot.hsr"))
    known, foo = robotctl("acl", "robot.hsr", *certs), robotctl("acl", "robot.foo", *certs)
    assert (known.code, known.err) == (0, "")
    assert foo.err == (
        "Warning: nobody has a certificate of robot.foo that holds (those that have one: robot.hsr)"
        ": `robotctl certs robot foo` makes it; this is what it would be allowed\n"
    )
    assert "robots/foo/state" in foo.out
    service = robotctl("acl", "planner", *certs)
    assert "`robotctl certs service planner` makes it" in service.err
