"""What the pages hand in: steps of the study, readings, notes of the browser. Each counts once, however often sent."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from app.session import pages
from app.session.connections import acknowledge, refuse
from app.session.context import Stage
from app.session.interfaces import Client
from app.session.private_text import apart
from app.session.transitions import Course
from app.wire import Message, Note, Submit, View
from app.worker.messages import SetView
from study.flow import protocol
from study.flow.steps import STEPS, AlertData, Refused, StepContext, parse
from study.records import EventRow


class Submissions:
    """Deals with what the pages of one session hand in."""

    def __init__(self, stage: Stage, course: Course) -> None:
        self._stage = stage
        self._course = course

    async def on_message(self, client: Client, message: Message) -> None:
        """A page sent something that is not about the hands."""
        if isinstance(message, Submit):
            await self._on_submit(client, message)
        elif isinstance(message, Note):
            data = {**message.data, "role": client.role}
            event = self._stage.event(message.name, "participant", data)
            await self._stage.commit(submission=message.id, events=(event,))
            acknowledge(client, message.id)
        elif isinstance(message, View):
            await self._on_view(client, message)

    async def _on_view(self, client: Client, message: View) -> None:
        if client.role != "participant":
            refuse(client, "illegal", "type", "the second device shows no robot")
            return
        if message.name not in dict(pages.VIEWS):
            refuse(client, "invalid", "name", f"no view {message.name!r}; there are {list(dict(pages.VIEWS))}")
            return
        self._stage.link.send(SetView(message.name))
        event = self._stage.event("view", "participant", {"name": message.name})
        await self._stage.commit(events=(event,))

    async def _on_submit(self, client: Client, message: Submit) -> None:
        stage, participant = self._stage, self._stage.enrolment.participant
        answered = await stage.around.store.run(lambda store: store.response(participant, message.id))
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
                event = stage.event(kind, "participant", data)
                response = {"code": refused.code, "problems": refused.problems}
                await stage.commit(submission=message.id, response=response, answers=refused.kept, events=(event,))
            for place, text in refused.problems:
                refuse(client, refused.code, place, text, message.id)
            if message.step == "eligibility" and refused.log:
                stage.lacking = tuple(refused.log[1]["lacking"])
                stage.measure()
        except protocol.IllegalEvent as illegal:
            refuse(client, "illegal", "step", str(illegal), message.id)
            client.deliver(stage.page())

    async def _on_step(self, client: Client, message: Submit) -> None:
        stage = self._stage
        condition = stage.enrolment.plan.trial(stage.session.trial).condition
        context = StepContext(
            study=stage.around.study,
            session=stage.session,
            condition=condition,
            utc=stage.around.now_utc(),
            public_id=stage.enrolment.public_id,
            round_trip_ms=stage.round_trips.median_ms,
            lacking=stage.lacking,
        )
        outcome = STEPS[message.step](context, message.data)
        data, private = apart(message.step, outcome.words)
        events = (stage.event(f"step_{message.step}", "participant", {**(outcome.log or {}), **data}),)
        if message.step == "help":
            stage.vitals.help_wanted = True
        elif message.step == "setup":
            stage.vitals.sound = bool(message.data.get("sound"))
        if outcome.event is None:
            await stage.commit(submission=message.id, events=events, private=private)
            acknowledge(client, message.id)
            return
        if message.step == "start" and stage.lacks_panel():
            text = "The second device is not connected. Open its link there first, and press its button."
            raise Refused("illegal", ("panel", text))
        if message.step == "start" and stage.session.worker and not stage.link.ready:
            raise Refused("illegal", ("step", "the robot is not ready yet"))
        await self._course.advance(
            outcome.event,
            events=events,
            submission=message.id,
            answers=outcome.answers,
            private=private,
            consent=(context.utc, outcome.consent_hash) if outcome.consent_hash else None,
            on_disk=lambda: acknowledge(client, message.id),
        )

    async def _on_alert_step(self, client: Client, message: Submit) -> None:
        stage, phase = self._stage, self._stage.phase
        placement = stage.around.study.distractor.placement
        if client.role != ("panel" if placement == "second_device" else "participant"):
            raise Refused("illegal", ("step", f"in this study readings are shown and logged on: {placement}"))
        data, utc = parse(AlertData, message.data), stage.around.now_utc()
        if phase.distractor.alert(data.alert) is None and not stage.session.is_ticking:
            # The trial ended while this was on its way: nobody did anything wrong.
            late = stage.event(f"{message.step}_too_late", "participant", data.model_dump())
            await stage.commit(submission=message.id, events=(late,))
            acknowledge(client, message.id)
            return
        if phase.distractor.alert(data.alert) is None:
            raise Refused("invalid", ("data.alert", f"no reading {data.alert} has been shown in this trial"))
        events: tuple[EventRow, ...] = ()
        if message.step == "alert_shown":
            phase.distractor = phase.distractor.shown(data.alert, utc)
        elif message.step == "alert_heard":
            phase.distractor = phase.distractor.heard(data.alert, utc)
        else:
            after, result = phase.distractor.answer(data.alert, data.value or "", phase.trial_s, utc)
            if result == "empty":
                raise Refused("invalid", ("data.value", "Please type the reading."))
            phase.distractor = after
            answer = {"alert": data.alert, "result": result, "value": data.value}
            events = (stage.event("alert_answer", "participant", answer),)
        await stage.commit(submission=message.id, alerts=(data.alert,), events=events)
        acknowledge(client, message.id)
        if events:
            stage.audience.show_reading(phase.distractor.alert(data.alert), phase.distractor, phase.trial_s)


def _answer_again(client: Client, identifier: str, response: Mapping[str, Any]) -> None:
    """A resend of something already dealt with gets the same answer."""
    for place, text in response.get("problems", ()):
        refuse(client, response["code"], place, text, identifier)
    if not response.get("problems"):
        acknowledge(client, identifier)
