"""A recruitment service's list beside the roster: who stands where in both, and what might be done about it. Pure.

A finding proposes an act and does nothing. `at the service` is what somebody does there: approve, look into, ask.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from study.flow.open_link import BEFORE_CONSENT
from study.flow.protocol import FREES_CELL
from study.flow.recruiter_list import Listed, ServiceState
from study.flow.roster import Enrolled

Kind = Literal[
    "agrees",
    "incomplete_here",
    "gone_there",
    "complete_here",
    "unknown_here",
    "unknown_there",
    "twice",
    "unclear",
]
LabAct = Literal["", "free_place", "abort", "reject"]
MEANINGS: Mapping[Kind, str] = {
    "agrees": "both say the same",
    "incomplete_here": "complete at the service, and not in the lab",
    "gone_there": "gone at the service, and still holding a place in the lab",
    "complete_here": "complete in the lab, and not at the service",
    "unknown_here": "on the service's list, and not in the roster",
    "unknown_there": "came over the open link, and not on the service's list",
    "twice": "stands more than once on the list, or in the roster",
    "unclear": "the service's word for it is not known, or it names nobody",
}
"""What each kind of finding is."""
_SENT_IN: frozenset[ServiceState] = frozenset({"approved", "awaiting"})
_GONE: frozenset[ServiceState] = frozenset({"returned", "timed_out", "no_show", "rejected", "screened_out"})


@dataclass(frozen=True)
class Known:
    """Somebody of the roster, with the ids they go by."""

    enrolled: Enrolled
    ids: tuple[str, ...]
    """Of the open link they came over, or the label they were given."""
    over_link: bool = True
    """Whether they came over the open link."""


@dataclass(frozen=True)
class Finding:
    """One person of either list."""

    kind: Kind
    person: str
    """The service's id."""
    participant: str
    """The lab's; "" where the lab knows nobody of that id."""
    service: str
    """What the service says of them; "" where it says nothing."""
    lab: str
    """What the lab says of them."""
    act: LabAct
    """What might be done in the lab; "" = nothing."""
    advice: str
    """What might be done, in a sentence."""


def reconcile(listed: Sequence[Listed], roster: Iterable[Known]) -> tuple[Finding, ...]:
    """A finding for everybody on the list and everybody of the roster who came over the open link, in that order."""
    everyone = [known for known in roster if known.enrolled.kind == "study"]
    of_id: dict[str, list[Known]] = {}
    for known in everyone:
        for one in dict.fromkeys(known.ids):
            of_id.setdefault(_same(one), []).append(known)
    times = Counter(_same(line.person) for line in listed)
    met: set[str] = set()
    findings = []
    for line in listed:
        if not line.person:
            advice = f"Line {line.line} of the list has no id: look who that is."
            findings.append(Finding("unclear", "", "", line.said, "", "", advice))
            continue
        here = of_id.get(_same(line.person), [])
        met.update(known.enrolled.participant for known in here)
        if len(here) > 1 or times[_same(line.person)] > 1:
            names = ", ".join(known.enrolled.participant for known in here)
            state = ", ".join(_state(known.enrolled) for known in here)
            advice = "Look at both: one person is to have one place and one payment."
            findings.append(Finding("twice", line.person, names, line.said, state, "", advice))
        else:
            findings.append(_compared(line, here[0].enrolled if here else None))
    for known in everyone:
        if known.over_link and known.enrolled.participant not in met:
            findings.append(_only_here(known))
    return tuple(findings)


def _same(person: str) -> str:
    """What ids are compared by: a service's export may write them in capitals."""
    return person.strip().casefold()


def _state(one: Enrolled) -> str:
    return "rejected" if one.rejected else one.state


def _compared(line: Listed, one: Enrolled | None) -> Finding:
    def finding(kind: Kind, act: LabAct, advice: str) -> Finding:
        participant, state = (one.participant, _state(one)) if one else ("", "")
        return Finding(kind, line.person, participant, line.said, state, act, advice)

    if line.state == "unclear":
        return finding("unclear", "", f"Look at the service what {line.said or 'an empty cell'!r} means.")
    if one is None:
        if line.state in _SENT_IN:
            return finding("unknown_here", "", "Ask them for what they did: the lab has nothing under this id.")
        return finding("unknown_here", "", "They never began; nothing is to be done.")
    if one.problem:
        return finding("unclear", "", "What the lab has stored of them cannot be read.")
    is_done, is_gone = one.state == "done" and not one.rejected, one.state in FREES_CELL or one.rejected
    if line.state in _SENT_IN:
        if is_done:
            return finding("agrees", "", "")
        if one.rejected:
            return finding("incomplete_here", "", "Their data were rejected in the lab. Decide at the service.")
        if one.state == "screened_out":
            return finding("incomplete_here", "", "They were screened out. Pay for that at the service, if it can.")
        return finding(
            "incomplete_here", "", "Do not approve yet: look at their session, and ask them how far they came."
        )
    if line.state in _GONE:
        if is_done and line.state == "rejected":
            return finding("complete_here", "reject", "Reject their data in the lab too, if they cannot be used.")
        if is_done:
            return finding("complete_here", "", "Their data are complete: pay them at the service.")
        if is_gone:
            return finding("agrees", "", "")
        if one.state in BEFORE_CONSENT:
            return finding("gone_there", "free_place", "Free their place: they have not agreed to take part.")
        return finding("gone_there", "abort", "End their session, which frees the place; what they did stays.")
    if is_done:
        return finding("complete_here", "", "They have yet to send it in at the service.")
    return finding("agrees", "", "")


def _only_here(known: Known) -> Finding:
    one, person = known.enrolled, known.ids[0] if known.ids else ""
    is_gone = one.state in FREES_CELL or one.rejected
    advice = "Nobody of this id is on the list: anybody with the link can make one up."
    if is_gone:
        return Finding("unknown_there", person, one.participant, "", _state(one), "", advice)
    if one.state in BEFORE_CONSENT:
        return Finding("unknown_there", person, one.participant, "", _state(one), "free_place", advice)
    return Finding("unknown_there", person, one.participant, "", _state(one), "", advice + " Look at their session.")


def summary(findings: Iterable[Finding]) -> dict[Kind, int]:
    """How many there are of each kind; kinds of which there are none are left out."""
    counted = Counter(finding.kind for finding in findings)
    return {kind: counted[kind] for kind in MEANINGS if counted[kind]}
