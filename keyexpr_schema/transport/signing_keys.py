"""Which keys of certificates sign, and how: the key alone says it, never who sends something.

Elliptic curves: ECDSA. RSA from 2048 bits on, which public-key infrastructures of companies have:
RSASSA-PSS with a salt as long as the hash (RFC 8017, 8.1). SHA-256 for both.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

LEAST_BITS = 2048
"""Of an RSA key; rustls, which Zenoh uses, takes none with fewer either."""

Sign = Callable[[bytes], bytes]
Verify = Callable[[bytes, bytes], None]
"""Takes a signature and what is signed; raises `InvalidSignature` where they do not belong."""


def _how(key: Any, of_curve: Any, of_rsa: Any) -> tuple[Any, ...]:
    """What `sign` and `verify` of a key take behind the bytes."""
    from cryptography.hazmat.primitives import hashes
    from cryptography.hazmat.primitives.asymmetric import ec, padding

    if isinstance(key, of_curve):
        return (ec.ECDSA(hashes.SHA256()),)
    if isinstance(key, of_rsa) and key.key_size >= LEAST_BITS:
        pss = padding.PSS(padding.MGF1(hashes.SHA256()), padding.PSS.DIGEST_LENGTH)
        return pss, hashes.SHA256()
    raise ValueError(
        "it is neither of an elliptic curve, as `robotctl certs` makes them, nor RSA of "
        f"{LEAST_BITS} bits or more"
    )


def signing(key: Any) -> Sign:
    """What signs with a private key.

    Raises:
        ValueError: such a key does not sign; why, as the end of a sentence.
    """
    from cryptography.hazmat.primitives.asymmetric import ec, rsa

    how = _how(key, ec.EllipticCurvePrivateKey, rsa.RSAPrivateKey)
    return lambda said: bytes(key.sign(said, *how))


def verifying(key: Any) -> Verify:
    """What verifies with a public key.

    Raises:
        ValueError: as `signing`.
    """
    from cryptography.hazmat.primitives.asymmetric import ec, rsa

    how = _how(key, ec.EllipticCurvePublicKey, rsa.RSAPublicKey)
    return lambda signature, said: key.verify(signature, said, *how)
