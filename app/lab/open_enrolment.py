"""Who comes over the open link: one participant for each id, for as long as there are places."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

from app.lab.lab import Lab
from app.lab.tokens import token_hash
from study.flow.open_link import BEFORE_CONSENT, IDENTITY_PREFIX, LAPSED, Answer, answer, read_ids
from study.flow.protocol import State
from study.records import EventRow, utc_text
from study.store import Batch, Store


@dataclass(frozen=True)
class Offer:
    """What somebody with a link is told, and once they are let in, the key to their page."""

    answer: Answer | Literal["bad_link", "busy"]
    """As the study's rules have it; `busy`: there are places, but as many people take part as the lab takes at once."""
    ids: Mapping[str, str] = field(default_factory=dict)
    wrong: tuple[str, ...] = ()
    public_id: str = ""
    token: str = ""


class OpenEnrolment:
    """Enrols people one after another, so that no two of them get the last place, and no one two."""

    def __init__(self, lab: Lab) -> None:
        self._lab = lab
        self._turn = asyncio.Lock()

    def person(self, given: Mapping[str, Sequence[str]]) -> str | None:
        """The id that says who it is; None when the link is not in order."""
        rules = self._lab.setup.study.recruitment
        ids, wrong = read_ids(rules, given, self._lab.setup.study.words)
        return None if wrong else ids[rules.person]

    async def look(self, given: Mapping[str, Sequence[str]], token: str) -> Offer:
        """What the link offers, changing nothing and not telling who has taken part.

        `token` is what this browser kept from an earlier visit under this id, "" if nothing.
        """
        rules = self._lab.setup.study.recruitment
        ids, wrong = read_ids(rules, given, self._lab.setup.study.words)
        if wrong:
            return Offer("bad_link", wrong=wrong) if rules.open else Offer("closed")
        await self._lab.lapsing.sweep()
        holder = await self._lab.holder(token) if token else None
        if holder is not None and holder[0].session.state != LAPSED:
            return Offer("back", ids)
        found = await self._found(ids)
        if found is not None and (await self._lab.stored_session(found)).session.state in BEFORE_CONSENT:
            return Offer("enrol", ids)  # they hold a place already, however full the study is
        reply = await self._answer(None, is_known=False)
        return Offer("busy" if reply == "enrol" and not self._has_room else reply, ids)

    async def join(self, given: Mapping[str, Sequence[str]], token: str) -> Offer:
        """Enrol a person, or let them back into their own session. As `look`, for somebody who pressed Begin."""
        rules = self._lab.setup.study.recruitment
        ids, wrong = read_ids(rules, given, self._lab.setup.study.words)
        if wrong:
            return Offer("bad_link", wrong=wrong) if rules.open else Offer("closed")
        async with self._turn:
            await self._lab.lapsing.sweep()
            found = await self._found(ids)
            if found is None:
                reply = await self._answer(None, is_known=False)
                if reply == "enrol" and not self._has_room:
                    return Offer("busy", ids)
                return await self._enrol(ids) if reply == "enrol" else Offer(reply, ids)
            stored = await self._lab.stored_session(found)
            holder = await self._lab.holder(token) if token else None
            is_known = holder is not None and holder[0].participant == found
            reply = await self._answer(stored.session.state, is_known)
            if reply == "enrol" and not self._has_room:
                return Offer("busy", ids)
            if reply == "enrol":  # their place has lapsed, and there is another
                reply = "back" if await self._lab.lapsing.give_back(stored) else "full"
            if reply != "back":
                return Offer(reply, ids)
            # Whoever else began under this id must not be there when this person has agreed to take part.
            self._lab.door.let_in(found)
            key = token if is_known else await self._lab.new_token(found, alone=True)
            return Offer("back", ids, (), stored.public_id, key)

    @property
    def _has_room(self) -> bool:
        """Whether one more can take part now. Places are another matter, and so is whoever holds one already."""
        return self._lab.door.crowding().has_room

    async def _found(self, ids: Mapping[str, str]) -> str | None:
        """The participant who began under the person's id."""
        person = self._lab.setup.study.recruitment.person
        kind, value = IDENTITY_PREFIX + person, ids[person]
        return await self._lab.store.read(lambda store: store.participant_of_identity(kind, value))

    async def _answer(self, state: State | None, is_known: bool) -> Answer:
        held = await self._lab.store.read(lambda store: store.cells_held())
        return answer(self._lab.setup.study.recruitment, held, state, is_known)

    async def _enrol(self, ids: Mapping[str, str]) -> Offer:
        """One more participant. Their ids are kept apart; the experimenter sees the person's as their label."""
        kept = {IDENTITY_PREFIX + name: value for name, value in ids.items()}
        label = ids[self._lab.setup.study.recruitment.person]
        made = await self._lab.invite(identities={"label": label, **kept})
        event = EventRow(made.participant, None, None, utc_text(self._lab.now_unix_s()), "joined", "participant", "{}")

        def note(store: Store) -> None:
            store.commit(Batch(events=(event,)))

        await self._lab.store.run(note)
        self._lab.door.let_in(made.participant)
        return Offer("enrol", ids, (), made.public_id, made.participant_token)


def cookie_name(person: str) -> str:
    """Where a browser keeps the key of the session begun under an id; several people may share a browser."""
    return f"salab_join_{token_hash(person)[:16]}"
