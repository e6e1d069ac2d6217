"""What the pages hand in: steps of the study, answers to alerts, notes of the browser.

Each counts once, however often it is sent.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from app.session import pages
from app.session.connections import acknowledge, refuse
from app.session.context import SessionContext
from app.session.interfaces import Client, HelpCall
from app.session.private_text import apart
from app.session.transitions import Transitions
from app.trial.reasoning import PartFault
from app.wire import Message, Note, Submit, View
from study.flow.distractors.interface import MAX_ANSWER_CHARACTERS
from study.flow.notes import read_note
from study.flow.page import Refused, StepContext, parse
from study.flow.protocol import IllegalEvent
from study.flow.steps import AlertData
from study.records import EventRow
from study.store import Batch, ConsentGiven

STEPS_OF_THE_STUDY = "step_"
"""How the events of steps begin."""


class Submissions:
    """Deals with what the pages of one session hand in."""

    def __init__(self, context: SessionContext, transitions: Transitions) -> None:
        self._context = context
        self._transitions = transitions

    async def on_message(self, client: Client, message: Message) -> None:
        """A page sent something that is not about the hands."""
        if isinstance(message, Submit):
            await self._on_submit(client, message)
        elif isinstance(message, Note):
            await self._on_note(client, message)
        elif isinstance(message, View):
            await self._on_view(client, message)

    async def _on_note(self, client: Client, message: Note) -> None:
        context = self._context
        try:
            kind, data = read_note(context.services.flow, message.name, message.data, client.role)
        except Refused as refused:
            for place, text in refused.problems:
                refuse(client, refused.code, place, text, message.id)
            return
        if message.name == "received":
            data["client"] = client.name
        event = context.event(kind, "participant", data)
        await context.commit(Batch(submission=context.submission(message.id), events=(event,)))
        acknowledge(client, message.id)
        if message.name == "panel_heard":
            context.vitals.panel_heard = data["heard"]
            context.connections.show_panel(data["heard"])

    async def _on_view(self, client: Client, message: View) -> None:
        if client.role != "participant":
            refuse(client, "illegal", "type", "the second device shows no robot")
            return
        if message.name not in dict(pages.VIEWS):
            refuse(client, "invalid", "name", f"no view {message.name!r}; there are {list(dict(pages.VIEWS))}")
            return
        self._context.view = message.name
        self._context.link.view(message.name)  # at once: nothing is acknowledged by it
        event = self._context.event("view", "participant", {"name": message.name})
        await self._context.commit(Batch(events=(event,)))

    async def _on_submit(self, client: Client, message: Submit) -> None:
        context, participant = self._context, self._context.enrolment.participant
        answered = await context.services.store.find(lambda store: store.response(participant, message.id))
        if answered is not None:
            _answer_again(client, message.id, answered)
            return
        try:
            if message.step.startswith("alert_"):
                await self._on_alert_step(client, message)
            elif client.role != "participant":
                raise Refused("illegal", ("step", f"{message.step!r} is not for the second device"))
            else:
                await self._on_step(client, message)
        except Refused as refused:
            fields = [place for place, _ in refused.problems]
            if refused.kept or refused.log:
                kind, data = refused.log or ("answers_not_right", {"step": message.step, "fields": fields})
                event = context.event(kind, "participant", data)
                response = {"code": refused.code, "problems": refused.problems}
                submission = context.submission(message.id, response)
                await context.commit(Batch(submission=submission, answers=refused.kept, events=(event,)))
            for place, text in refused.problems:
                refuse(client, refused.code, place, text, message.id)
            if message.step == "eligibility" and refused.log:
                context.lacking = tuple(refused.log[1]["lacking"])
                context.measure()
        except IllegalEvent as illegal:
            refuse(client, "illegal", "step", str(illegal), message.id)
            client.deliver(context.page())

    async def _on_step(self, client: Client, message: Submit) -> None:
        context = self._context
        step = StepContext(
            study=context.services.study,
            session=context.session,
            condition=context.enrolment.plan.trial(context.session.trial).condition,
            utc=context.services.now_utc(),
            public_id=context.enrolment.public_id,
            round_trip_ms=context.round_trips.median_ms,
            lacking=context.lacking,
        )
        outcome = context.services.flow.steps[message.step](step, message.data)
        data, private = apart(message.step, outcome.words)
        events = (context.event(f"{STEPS_OF_THE_STUDY}{message.step}", "participant", {**(outcome.log or {}), **data}),)
        if message.step == "help":
            context.vitals.help = HelpCall(outcome.words or "", step.utc)
        elif message.step == "picture":
            context.vitals.picture = bool(message.data.get("there"))
        elif message.step == "setup":
            context.vitals.sound = bool(message.data.get("sound"))
        batch = Batch(
            submission=context.submission(message.id),
            events=events,
            answers=outcome.answers,
            identities=context.identities(private),
            consent=ConsentGiven(step.utc, outcome.consent_hash) if outcome.consent_hash else None,
        )
        if outcome.frees:
            await self._transitions.free("participant", batch, on_disk=lambda: acknowledge(client, message.id))
            return
        if outcome.event is None:
            await context.commit(batch)
            acknowledge(client, message.id)
            return
        words = context.services.study.words
        if message.step == "start" and context.lacks_panel():
            text = words.t("The second device is not connected. Open it with the code or the link on this page.")
            raise Refused("illegal", ("panel", text))
        if message.step == "start" and context.vitals.picture is False:
            raise Refused("illegal", ("picture", words.t("The picture of the robot is missing on this screen.")))
        if message.step == "start" and context.session.worker and not context.link.ready:
            raise Refused("illegal", ("step", words.t("The robot is not ready yet.")))
        await self._transitions.advance(outcome.event, batch, on_disk=lambda: acknowledge(client, message.id))

    async def _on_alert_step(self, client: Client, message: Submit) -> None:
        context, running = self._context, self._context.running
        study, named = context.services.study, context.services.distractor.words
        placement, words = study.distractor.placement, study.words
        if client.role != ("panel" if placement == "second_device" else "participant"):
            raise Refused("illegal", ("step", f"in this study {named.many} are shown and logged on: {placement}"))
        data, utc = parse(AlertData, message.data), context.services.now_utc()
        if running.distractor.alert(data.alert) is None and not context.session.is_ticking:
            # The trial ended while this was on its way: nobody did anything wrong.
            late = context.event(f"{message.step}_too_late", "participant", data.model_dump())
            await context.commit(Batch(submission=context.submission(message.id), events=(late,)))
            acknowledge(client, message.id)
            return
        if running.distractor.alert(data.alert) is None:
            raise Refused("invalid", ("data.alert", f"no {named.one} {data.alert} has been shown in this trial"))
        events: tuple[EventRow, ...] = ()
        if message.step == "alert_shown":
            running.distractor = running.distractor.shown(data.alert, utc)
        elif message.step == "alert_heard":
            running.distractor = running.distractor.heard(data.alert, utc)
        else:
            try:
                after, result = running.distractor.answer(data.alert, data.value or "", running.trial_s, utc)
            except PartFault as fault:
                await self._transitions.distractor_failed(fault)
                text = words.t("The lab could not take this answer, and has paused.")
                raise Refused("illegal", ("step", text)) from fault
            if result == "empty":
                raise Refused("invalid", ("data.value", words.t("Please give an answer.")))
            if result == "too_long":
                text = words.t(
                    "This has {n} characters, and at most {most} can be saved. Please shorten it.",
                    n=len(data.value or ""),
                    most=MAX_ANSWER_CHARACTERS,
                )
                raise Refused("invalid", ("data.value", text))
            if result == "unreadable":
                raise Refused("invalid", ("data.value", words.t("This holds a character that nobody can read.")))
            if result == "no_number":
                text = words.t("“{typed}” is not a number.", typed=data.value or "")
                raise Refused("invalid", ("data.value", text))
            if result == "no_choice":
                choices = running.distractor.alerts[data.alert - 1].stimulus.choices
                ids = ", ".join(choice.id for choice in choices)
                raise Refused("invalid", ("data.value", f"{data.value!r} is none of the answers: {ids}"))
            running.distractor = after
            answer = {"alert": data.alert, "result": result, "value": data.value}
            events = (context.event("alert_answer", "participant", answer),)
        alerts = context.alert_rows((data.alert,))
        await context.commit(Batch(submission=context.submission(message.id), alerts=alerts, events=events))
        acknowledge(client, message.id)
        if events:
            context.connections.show_alert(running.distractor.alert(data.alert), running.distractor, running.trial_s)


def _answer_again(client: Client, identifier: str, response: Mapping[str, Any]) -> None:
    """A resend of something already dealt with gets the same answer."""
    for place, text in response.get("problems", ()):
        refuse(client, response["code"], place, text, identifier)
    if not response.get("problems"):
        acknowledge(client, identifier)
