"""Certificates as another public-key infrastructure makes them."""

from __future__ import annotations

from cryptography import x509
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec, ed25519, rsa
from cryptography.hazmat.primitives.serialization import (
    Encoding,
    NoEncryption,
    PrivateFormat,
    load_pem_private_key,
)

from cli.certificates.authority import CA_KEY, Authority
from cli.certificates.identity import Identity

OtherKey = rsa.RSAPrivateKey | ec.EllipticCurvePrivateKey | ed25519.Ed25519PrivateKey


def rekey(office: Authority, who: str, key: OtherKey) -> None:
    """Give somebody who has a certificate of `office` the same one for another `key`."""
    files = office.files(Identity.parse(who))
    was = x509.load_pem_x509_certificate(files.certificate.read_bytes())
    builder = (
        x509.CertificateBuilder()
        .subject_name(was.subject)
        .issuer_name(was.issuer)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(was.not_valid_before_utc)
        .not_valid_after(was.not_valid_after_utc)
    )
    for each in was.extensions:
        builder = builder.add_extension(each.value, each.critical)
    signs = load_pem_private_key((office.folder / CA_KEY).read_bytes(), None)
    assert isinstance(signs, ec.EllipticCurvePrivateKey)
    certificate = builder.sign(signs, hashes.SHA256())
    files.certificate.write_bytes(certificate.public_bytes(Encoding.PEM))
    files.key.write_bytes(key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption()))
