"""The lab's key: Ed25519, made with the first certificate, in a file of the data folder that its owner alone can read.

Whoever can read it can sign anything: it tells this lab from others, not an administrator from an honest one.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

KEY_NAME = "lab.key"


def sign(folder: Path, text: str) -> str:
    """The signature of a text by the key of a data folder, in hex."""
    return _key(folder).sign(text.encode()).hex()


def public_key(folder: Path) -> str:
    """The public half of a data folder's key, in hex; the key is made if there is none."""
    return str(_key(folder).public_key().public_bytes_raw().hex())


def key_problem(folder: Path) -> str:
    """Why the key of a data folder cannot be used; "" when it can, or is yet to be made."""
    try:
        if (folder / KEY_NAME).exists():
            _key(folder)
    except (OSError, ValueError) as error:
        return f"{folder / KEY_NAME}: {error}"
    return ""


def is_signed(key: str, text: str, signature: str) -> bool:
    """Whether a public key's owner signed this text."""
    from cryptography.exceptions import InvalidSignature
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey

    try:
        Ed25519PublicKey.from_public_bytes(bytes.fromhex(key)).verify(bytes.fromhex(signature), text.encode())
    except (InvalidSignature, ValueError):
        return False
    return True


def _key(folder: Path) -> Ed25519PrivateKey:
    """Raises `OSError` or `ValueError` for a key that cannot be read or made."""
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

    path = folder / KEY_NAME
    try:
        return Ed25519PrivateKey.from_private_bytes(bytes.fromhex(path.read_text(encoding="ascii")))
    except FileNotFoundError:
        made = Ed25519PrivateKey.generate()
    unfinished = path.with_name(f".{KEY_NAME}.{os.getpid()}")
    file = os.open(unfinished, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
    try:
        os.write(file, made.private_bytes_raw().hex().encode("ascii"))
        os.fsync(file)
    finally:
        os.close(file)
    os.replace(unfinished, path)
    return made
