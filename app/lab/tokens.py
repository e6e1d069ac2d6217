"""Tokens: 192 random bits in a link, and only their hash on disk."""

from __future__ import annotations

import hashlib
import hmac
import itertools
import math
import secrets
from collections import Counter, OrderedDict
from collections.abc import Sequence

from app.errors import LabError

TOKEN_BYTES = 24
LEAST_TOKEN_CHARACTERS = 24
LEAST_TOKEN_BITS = 80


def new_token() -> str:
    """A fresh URL-safe token with 192 random bits."""
    return secrets.token_urlsafe(TOKEN_BYTES)


def token_hash(token: str) -> str:
    """What is stored of a token."""
    return hashlib.sha256(token.encode()).hexdigest()


def check_strength(token: str, name: str = "the experimenter's token") -> None:
    """Raises `LabError` for a token that somebody could guess; the experimenter's opens everything.

    The bits of a text are estimated from how unevenly its characters, and the steps from each to the next, are
    distributed; of one that repeats itself, only its unit counts. A made one has far more.
    """
    wrong = ""
    if not all("!" <= one <= "~" for one in token):
        wrong = "has characters other than the letters, digits and marks of ASCII"
    elif len(token) < LEAST_TOKEN_CHARACTERS:
        wrong = f"has {len(token)} characters; it must have at least {LEAST_TOKEN_CHARACTERS}"
    elif (bits := _bits(token)) < LEAST_TOKEN_BITS:
        wrong = f"can be guessed: about {bits:.0f} bits, at least {LEAST_TOKEN_BITS} are needed"
    if wrong:
        raise LabError(
            f"{name} {wrong}. Make one with: python3 -c 'import secrets; "
            "print(secrets.token_urlsafe(24))', or set none and the lab makes one"
        )


def _bits(text: str) -> float:
    unit = text[: (text + text).find(text, 1)]  # "abcabc" is "abc" again and again
    steps = [ord(after) - ord(before) for before, after in itertools.pairwise(unit)]
    return min(_entropy(unit), _entropy(steps)) * len(unit)


def _entropy(things: Sequence[object]) -> float:
    shares = [count / len(things) for count in Counter(things).values()]
    return sum(-share * math.log2(share) for share in shares) + 0.0  # never -0


def dashboard_key(experimenter_token: str) -> str:
    """What opens the pages of a dashboard that a browser asks for without our headers: frames, pictures, tabs.

    It follows from the token and does not lead back to it.
    """
    return hmac.new(experimenter_token.encode(), b"desk", hashlib.sha256).hexdigest()


def same_token(given: str, expected: str) -> bool:
    """Compare without telling by the time taken where they differ."""
    return hmac.compare_digest(given.encode(), expected.encode())


class Attempts:
    """Counts what an address has tried, in constant memory, so that guessing becomes slow.

    Counted are different things only: a page that was left open and repeats one stale token guesses nothing. At most
    `addresses` addresses are remembered, the least recent ones are forgotten first.
    """

    def __init__(self, allowed: int = 10, within_s: float = 60.0, addresses: int = 1000) -> None:
        self.allowed = allowed
        self.within_s = within_s
        self.addresses = addresses
        self._tried: OrderedDict[str, dict[str, float]] = OrderedDict()

    def add(self, address: str, tried: str, now_s: float) -> float:
        """Another one; the seconds this address has to wait, 0 = none."""
        recent = {
            digest: tried_s
            for digest, tried_s in self._tried.pop(address, {}).items()
            if now_s - tried_s < self.within_s
        }
        self._tried[address] = recent
        if len(self._tried) > self.addresses:
            self._tried.popitem(last=False)
        digest = token_hash(tried)
        if digest not in recent and len(recent) >= self.allowed:
            return self.within_s - (now_s - min(recent.values()))
        recent[digest] = now_s
        return 0.0
