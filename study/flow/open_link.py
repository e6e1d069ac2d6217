"""An open link: the ids in it, who is let in over it, and the links it leads on to.

An id is what a recruitment service or a mail gave somebody. It is no proof of who they are: whoever knows an id can
begin under it. So once somebody has agreed to take part, their id alone opens nothing; the browser they did it in does.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Literal

from study.definition.sections import Recruitment
from study.flow.protocol import State
from study.language.words import ENGLISH, Words

MAX_ID_CHARACTERS = 100
_ID = re.compile(rf"[A-Za-z0-9._~@-]{{1,{MAX_ID_CHARACTERS}}}\Z")
"""What needs no escaping in an address."""
_WORDS = re.compile(
    r"(your|my|insert|enter|put|the)*(prolific|participant|worker|user|student|subject|person|respondent|study|session"
    r"|survey|assignment|hit|mail|panel)?(id|pid|code|number|name|token)(here)?|assignmentidnotavailable"
    r"|undefined|null|none|nan|example|placeholder|x{3,}"
)
"""What stands for an id where nothing was filled in, in small letters without anything between the words: in the lab's
own link, in mail merges, in a service's preview, and what a script makes of an id that it does not have."""
BEFORE_CONSENT: frozenset[State] = frozenset({"eligibility", "consent"})
"""States in which nothing is known of somebody that could be told to another who has their id."""

LAPSED: State = "lapsed"
"""The state of somebody whose place has lapsed: to the link they are as unknown as before they came."""
IDENTITY_PREFIX = "id."
"""What the kinds of these ids begin with in the store, beside the parameter's name."""

Answer = Literal["enrol", "back", "elsewhere", "full", "closed"]


def read_ids(
    rules: Recruitment, given: Mapping[str, Sequence[str]], words: Words = ENGLISH
) -> tuple[dict[str, str], tuple[str, ...]]:
    """The ids in a link's parameters, and a sentence for each thing that is wrong with them.

    Parameters the study does not know are left alone; of those it knows, only the person's must be there.
    """
    ids, wrong = {}, []
    for name in rules.id_parameters:
        values = [value.strip() for value in given.get(name, ()) if value.strip()]
        if len(values) > 1:
            wrong.append(words.t("{name} stands {n} times in the link.", name=name, n=len(values)))
        elif values and is_placeholder(name, values[0]):
            wrong.append(
                words.t(
                    "{name} is still a placeholder: each person's own id belongs there, and whoever gave out the link "
                    "did not put it in.",
                    name=name,
                )
            )
        elif values and not _ID.match(values[0]):
            wrong.append(
                words.t(
                    "{name} is not filled in as it should be: at most {most} letters, digits, and . _ ~ @ -",
                    name=name,
                    most=MAX_ID_CHARACTERS,
                )
            )
        elif values:
            ids[name] = values[0]
        elif name == rules.person:
            wrong.append(words.t("{name} is missing in the link.", name=name))
    return ids, tuple(wrong)


def is_placeholder(name: str, value: str) -> bool:
    """Whether a value says where the id of this parameter belongs, and is none: `ID`, `{{%PROLIFIC_PID%}}`,
    `${workerId}`, `[mail_code]`, `mail_code` and their like, whichever marks the service puts around it."""
    if re.search(r"[{}<>\[\]%$|*]|\A@.*@\Z", value):
        return True
    plain, parameter = (re.sub(r"[^a-z0-9]", "", text.lower()) for text in (value, name))
    if not plain:
        return _ID.match(value) is not None
    return plain == parameter or _WORDS.fullmatch(plain) is not None


def ids_among(identities: Iterable[tuple[str, str]]) -> dict[str, str]:
    """Of everything identifying that is stored about somebody, (kind, value), the ids of their link by parameter."""
    return {kind.removeprefix(IDENTITY_PREFIX): value for kind, value in identities if kind.startswith(IDENTITY_PREFIX)}


_SERVICES: Mapping[str, str] = {
    **{name: f"{{{{%{name}%}}}}" for name in ("PROLIFIC_PID", "STUDY_ID", "SESSION_ID")},
    "survey_code": "%SURVEY_CODE%",
}
"""What recruitment services want to stand for an id that they fill in: Prolific, SONA."""


def open_link(base_url: str, rules: Recruitment) -> str:
    """The link to give out, with a place for every id."""
    query = "&".join(f"{name}={_SERVICES.get(name, 'ID')}" for name in rules.id_parameters)
    return f"{base_url}/join?{query}"


def answer(rules: Recruitment, held: int, state: State | None, is_known: bool) -> Answer:
    """What somebody with an id is told.

    `held` counts the participants who hold a cell, `state` is that of the session begun under this id (None = none
    was; whose place has lapsed is as new), `is_known` says whether this browser is the one that began it.
    """
    if state is not None and state != LAPSED:
        return "back" if is_known or state in BEFORE_CONSENT else "elsewhere"
    if not rules.open:
        return "closed"
    return "full" if held >= rules.quota else "enrol"
