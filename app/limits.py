"""What a client may cost the lab at most, in one table; and how often each bound was reached.

A bound is generous: 24 people behind the one address of a university begin together without touching any. Whoever goes
beyond is told so in a typed refusal, and their connection is closed.
"""

from __future__ import annotations

import ipaddress
from collections import Counter, OrderedDict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, Literal, get_args

from app.errors import LabError


@dataclass(frozen=True)
class Limits:
    """Every bound. The lab's option `--limit NAME=VALUE` sets one."""

    connections: int = 4000
    """Open connections in all; fewer where the system gives the lab fewer file descriptors."""
    connections_per_address: int = 1000
    """Open connections from one address. A participant's browser has up to fifteen."""
    head_s: float = 10.0
    """Seconds within which the head of a request must have come."""
    head_bytes: int = 65_536
    """Size of a request's head."""
    body_s: float = 30.0
    """Seconds within which the body of a request must have come."""
    body_bytes: int = 1_000_000
    """Size of a request's body."""
    idle_s: int = 5
    """Seconds that a connection stays open between two requests."""
    unread_s: float = 60.0
    """Seconds that a client may take nothing of what it was sent."""
    requests_per_s: float = 100.0
    """Requests a second from one address, for as long as one likes. Whoever has the experimenter's token is not
    counted."""
    requests_burst: int = 4000
    """Requests from one address at once. A participant's page loads some seventy files."""
    wrong_tokens_per_min: int = 10
    """Different wrong experimenter's tokens from one address a minute."""
    wrong_links_per_min: int = 60
    """Different links that open nothing, from one address a minute."""
    joins_per_min: int = 60
    """Presses of the open link's button from one address a minute."""
    evaluations_per_s: float = 10.0
    """Evaluations of the arbiter a second from one address, for as long as one likes; one with many goals counts once
    per ten goals. Whoever has the experimenter's token is not counted."""
    evaluations_burst: int = 200
    """Evaluations of the arbiter from one address at once, counted alike."""
    evaluations_waiting: int = 16
    """Evaluations that wait for their turn; one is computed at a time."""
    hello_s: float = 10.0
    """Seconds within which a socket must say who it is."""
    strangers_per_address: int = 20
    """Dashboards' sockets from one address that have not shown their token yet."""
    dashboards: int = 20
    """Dashboards that are open."""
    spectators: int = 20
    """Experimenters' 3-D views that are open."""
    sockets_per_session: int = 8
    """Connections to one session: page, second device, 3-D views."""
    frames_per_s: float = 1000.0
    """Frames a second on any socket, for as long as one likes: pieces of messages and pings too."""
    frames_burst: int = 5000
    """Frames on any socket at once."""
    frame_bytes: int = 262_144
    """Size of a message on any socket, above which it is cut off unread. A page's own message may have 65536."""
    messages_per_s: float = 200.0
    """Messages a second from the pages of a session, for as long as one likes; in lockstep only frames count."""
    messages_burst: int = 3000
    """Messages from the pages of a session at once, such as all that a network held back."""
    message_bytes_per_s: float = 65_536.0
    """Bytes a second from the pages of a session, for as long as one likes."""
    message_bytes_burst: int = 2_000_000
    """Bytes from the pages of a session at once."""
    records_per_s: float = 20.0
    """Submits and notes a second from the pages of a session: what is written to disk."""
    records_burst: int = 1500
    """Submits and notes from the pages of a session at once. A page keeps up to 500 and sends them again."""
    waiting_messages: int = 32
    """Messages of one socket that wait to be dealt with; meanwhile no more are read."""
    unsent_messages: int = 1000
    """Messages that wait for a page to take them; a page that lets more pile up is cut off."""
    addresses: int = 10_000
    """Addresses that are remembered for counting; the least recent are forgotten first."""


def with_limits(given: Iterable[str]) -> Limits:
    """The bounds, with those of `NAME=VALUE` texts. Raises `LabError` for a name or a value that is none."""
    limits = Limits()
    kinds = {field.name: type(getattr(limits, field.name)) for field in fields(Limits)}
    changes: dict[str, Any] = {}
    for text in given:
        name, _, value = (part.strip() for part in text.partition("="))
        if name not in kinds:
            raise LabError(f"--limit {text}: no limit {name!r}; there are {', '.join(kinds)}")
        try:
            changes[name] = kinds[name](value)
        except ValueError:
            noun = "a whole number" if kinds[name] is int else "a number"
            raise LabError(f"--limit {text}: {value!r} is not {noun}") from None
        if not 0 < changes[name] < MOST:
            raise LabError(f"--limit {text}: must be above 0 and below {MOST:g}")
    return replace(limits, **changes)


MOST = 1e12

Bound = Literal[
    "host",
    "connections",
    "head",
    "body",
    "unread",
    "requests",
    "wrong_tokens",
    "wrong_links",
    "joins",
    "evaluations",
    "hello",
    "sockets",
    "frames",
    "messages",
    "records",
    "unsent",
]
"""What somebody was refused for. `head` and `body`: late or too large."""


class Refusals:
    """How often each bound was reached since the lab began."""

    def __init__(self) -> None:
        self._counts: Counter[Bound] = Counter(dict.fromkeys(get_args(Bound), 0))

    def add(self, bound: Bound) -> None:
        """Somebody went beyond it."""
        self._counts[bound] += 1

    @property
    def counts(self) -> Mapping[Bound, int]:
        """By bound, all of them."""
        return dict(self._counts)


class Bucket:
    """Lets `burst` things through at once and `per_s` a second for ever."""

    def __init__(self, per_s: float, burst: float) -> None:
        self.per_s = per_s
        self.burst = burst
        self._left = burst
        self._filled_s: float | None = None

    def take(self, now_s: float, amount: float = 1.0) -> bool:
        """Whether there is room for this much, which is taken then."""
        if self.left(now_s) < amount:
            return False
        self._left -= amount
        return True

    def left(self, now_s: float) -> float:
        """How much there is room for."""
        if self._filled_s is not None:
            self._left = min(self.burst, self._left + max(0.0, now_s - self._filled_s) * self.per_s)
        self._filled_s = now_s
        return self._left

    def wait_s(self, now_s: float, amount: float = 1.0) -> float:
        """Seconds until there is room for this much."""
        return max(0.0, amount - self.left(now_s)) / self.per_s


RECORDS_PER_SOCKET = 10
"""That a page comes and goes is recorded too."""


class Meter:
    """What the pages of one session have said lately, on however many sockets, one after the other or at once."""

    def __init__(self, limits: Limits) -> None:
        self._messages = Bucket(limits.messages_per_s, limits.messages_burst)
        self._bytes = Bucket(limits.message_bytes_per_s, limits.message_bytes_burst)
        self._records = Bucket(limits.records_per_s, limits.records_burst)

    def opened(self, now_s: float) -> bool:
        """Another socket: whether it is let in. It takes as much as some records do; and where hardly anything is left
        to say, it is not."""
        room = self._records.take(now_s, RECORDS_PER_SOCKET)
        return room and not self._is_spent(now_s)

    def _is_spent(self, now_s: float) -> bool:
        return any(one.left(now_s) < one.burst / 4 for one in (self._messages, self._bytes, self._records))

    def heard(self, size_bytes: int, now_s: float, is_paced: bool = True) -> str:
        """One more frame, before it is read: what there is too much of, "" when nothing. `is_paced`: not in lockstep,
        whose clients send as fast as ticks are computed."""
        if is_paced and not self._messages.take(now_s):
            return f"this page sends more than {self._messages.per_s:g} messages a second"
        if is_paced and not self._bytes.take(now_s, size_bytes):
            return f"this page sends more than {self._bytes.per_s:g} bytes a second"
        return ""

    def recorded(self, now_s: float, is_paced: bool = True) -> str:
        """One more that is to be written to disk: as `heard`."""
        if is_paced and not self._records.take(now_s):
            return f"this page sends more than {self._records.per_s:g} submits and notes a second"
        return ""


class BucketsByAddress:
    """A bucket for each address, for so many of them; the least recent are forgotten first."""

    def __init__(self, per_s: float, burst: float, addresses: int) -> None:
        self._per_s = per_s
        self._burst = burst
        self._addresses = addresses
        self._buckets: OrderedDict[str, Bucket] = OrderedDict()

    def take(self, address: str, now_s: float, amount: float = 1.0) -> float:
        """So much more from this address: 0, or the seconds it has to wait."""
        key = network_of(address)
        bucket = self._buckets.pop(key, None) or Bucket(self._per_s, self._burst)
        self._buckets[key] = bucket
        if len(self._buckets) > self._addresses:
            self._buckets.popitem(last=False)
        return 0.0 if bucket.take(now_s, amount) else bucket.wait_s(now_s, amount)


def network_of(address: str) -> str:
    """What is counted as one client: an IPv4 address, or the /64 network of an IPv6 address, which is one house's."""
    try:
        parsed = ipaddress.ip_address(address.partition("%")[0])
    except ValueError:
        return address
    if isinstance(parsed, ipaddress.IPv4Address):
        return str(parsed)
    if parsed.ipv4_mapped is not None:
        return str(parsed.ipv4_mapped)
    return str(ipaddress.ip_network((int(parsed) >> 64 << 64, 64)))
