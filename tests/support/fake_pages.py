"""What the fake lab shows in each state, and messages of a running trial, with the words of the shipped study."""

from __future__ import annotations

from typing import Any

from app.session.commands import ACTS
from sim.view.viewpoints import VIEWS
from study.definition.builtin_questionnaires import INSTRUMENTS
from study.flow.protocol import TERMINAL

Message = dict[str, Any]

NEXT: dict[tuple[str, str], str] = {
    ("eligibility", "eligibility"): "consent",
    ("consent", "consent"): "demographics",
    ("demographics", "demographics"): "setup",
    ("setup", "setup"): "instructions",
    ("instructions", "instructions"): "practice_ready",
    ("practice_ready", "start"): "practice",
    ("trial_ready", "start"): "trial",
    ("survey", "survey"): "break",
    ("break", "continue"): "practice_ready",
    ("debrief", "debrief"): "done",
    ("paused", "resume"): "trial",
}
ENDS = {"withdraw": "withdrawn", "decline": "withdrawn", "leave": "screened_out"}

OBJECTS = {
    "spray_bottle": "spray bottle",
    "bleach_bottle": "bleach bottle",
    "paper_towels": "paper towels",
    "wipes_tub": "tub of wipes",
    "absorbent_can": "can of absorbent",
    "sponge_pack": "pack of sponges",
    "practice_block": "practice block",
}
BINS = {"left_bin": "left bin", "right_bin": "right bin"}


def instruction(kind: str, thing: str, into: str | None = None) -> Message:
    words = {
        "pickup": f"Pick up the {OBJECTS[thing]}.",
        "dropoff": f"Drop the {OBJECTS[thing]} into the {BINS.get(into or '', '')}.",
        "practice": f"Practice: pick up the {OBJECTS[thing]}.",
        "reset": "The arm goes back to its start. Please wait.",
    }
    return {
        "type": "instruction",
        "text": words[kind],
        "kind": kind,
        "object": thing,
        "object_label": OBJECTS[thing],
        "bin": into,
        "bin_label": BINS[into] if into else None,
    }


def tick(number: int, **changes: Any) -> Message:
    return {
        "type": "tick",
        "tick": number,
        "seq": 0,
        "status": "running",
        "instruction": instruction("pickup", "spray_bottle"),
        "done_tasks": 0,
        "tasks": 6,
        "gripper": "open",
        "holding": False,
        "blocked": False,
        "assisting": None,
        "notice": None,
        "ending": None,
        **changes,
    }


def alert(number: int = 1, reading: str = "582.4", elapsed_s: float = 0.0) -> Message:
    return {
        "type": "alert",
        "alert": number,
        "reading": reading,
        "entry": "number",
        "elapsed_s": elapsed_s,
        "answer_within_s": 20.0,
        "away_min_s": 5.0,
    }


def letter(number: int = 1, text: str = "K", elapsed_s: float = 0.0) -> Message:
    """A letter of N-back, as `study.flow.distractors.nback` asks about it."""
    choices = [{"id": "same", "label": "Same", "key": "1"}, {"id": "different", "label": "Different", "key": "2"}]
    prompt = "Is this letter the same as the one 2 before?"
    return {**alert(number, text, elapsed_s), "entry": "text", "prompt": prompt, "choices": choices}


def _driving(kind: str, thing: str, tasks: int, running: bool) -> Message:
    return {
        "scene": "/s/test/scene/",
        "views": [{"name": view.name, "label": view.label} for view in VIEWS.values()],
        "instruction": instruction(kind, thing),
        "tasks": tasks,
        "running": running,
        "ready": True,
        "away_min_s": 5.0,
    }


def _choices(**labels: str) -> list[Message]:
    return [{"id": key, "label": label} for key, label in labels.items()]


CONTENT: dict[str, Message] = {
    "eligibility": {
        "title": "Moving objects with a robot arm",
        "checks": ["round_trip", "gamepad", "sound"],
        "gamepad": "required",
        "browsers": [],
        "tones": [3, 2],
    },
    "consent": {
        "title": "Moving objects with a robot arm",
        "text": [
            "You are invited to take part in a study about how people control a robot arm while something else also "
            "needs their attention. Your part takes about 45 minutes.",
            "You will drive a simulated robot arm with a gamepad or the keyboard, move objects from a table into "
            "bins, and log readings that appear on the screen with a loud sound.",
            "We record what you do with the controls, when and how you log the readings, and your answers. Your name "
            "is not part of these records.",
            "Taking part is voluntary. You can stop at any time, without giving a reason.",
        ],
        "contact": "Questions about the study are answered by the researcher who gave you the link.",
        "hash": "abc123",
    },
    "demographics": {
        "items": [
            {
                "id": "age_group",
                "prompt": "How old are you?",
                "kind": "choice",
                "required": True,
                "options": _choices(a="18 to 24", b="25 to 34", c="35 to 44", d="45 or older", n="Prefer not to say"),
            },
            {
                "id": "gender",
                "prompt": "What is your gender?",
                "kind": "choice",
                "required": False,
                "options": _choices(woman="Woman", man="Man", other="Another", n="Prefer not to say"),
            },
            {
                "id": "gaming_experience",
                "prompt": "How often do you play video games?",
                "kind": "choice",
                "required": True,
                "options": _choices(never="Never", weekly="Every week", daily="Every day or almost"),
            },
            {
                "id": "hours",
                "prompt": "Hours of games a week",
                "kind": "number",
                "options": [],
                "required": False,
                "least": 0,
                "most": 168,
            },
            {"id": "job", "prompt": "What do you do?", "kind": "text", "options": [], "required": False},
        ]
    },
    "setup": {"placement": "same_page_away", "panel_link": None},
    "instructions": {
        "text": [
            "There has been a chemical spill. You clean up from a safe distance: the robot arm moves objects from "
            "the table into two bins, and you drive it.",
            "The page always tells you which object comes next and which bin it belongs to. Move the gripper around "
            "the object, close it, lift the object, carry it over the bin, and open the gripper.",
            "While you work, sensor readings appear with a loud sound. Log each reading within 20 seconds.",
            "The robot may move by itself when your hands are off the controls. Whenever you use the controls, the "
            "arm does what you say.",
        ],
        "questions": [
            {
                "id": "which_object",
                "prompt": "Which object do you pick up next?",
                "options": _choices(nearest="The one nearest to the gripper", named="The one named on the page"),
            },
            {
                "id": "on_sound",
                "prompt": "What do you do when you hear the loud sound?",
                "options": _choices(ignore="Finish the current object first", log="Type the reading within 20 seconds"),
            },
            {
                "id": "robot_moves",
                "prompt": "The robot moves although your hands are off. What happens when you use the controls?",
                "options": _choices(obeys="The arm does what I say", ignores="The arm goes on by itself"),
            },
        ],
    },
    "practice_ready": _driving("practice", "practice_block", 2, False),
    "practice": _driving("practice", "practice_block", 2, True),
    "trial_ready": _driving("pickup", "spray_bottle", 6, False),
    "trial": _driving("pickup", "spray_bottle", 6, True),
    "survey": {
        "instruments": [
            {
                "id": instrument.id,
                "title": instrument.title,
                "intro": instrument.intro,
                "source": instrument.source,
                "points": instrument.points,
                "items": [
                    {"id": item.id, "text": item.text, "low": item.low, "high": item.high} for item in instrument.items
                ],
            }
            for instrument in INSTRUMENTS.values()
        ]
    },
    "break": {"text": ["This round is done. Take a break for as long as you like."], "next_trial": 2},
    "debrief": {
        "text": ["That was the last round. Thank you!", "The three rounds differed in what the robot did."],
        "questions": [{"id": "comments", "prompt": "Is there anything you would like to tell us?"}],
    },
    "done": {
        "text": ["Thank you for taking part. Your answers are saved, and you can close this page."],
        "completion_link": "https://example.org/done",
    },
    "withdrawn": {"text": ["You have ended your participation. Thank you for your time."], "completion_link": None},
    "aborted": {"text": ["The experimenter has ended the session."], "completion_link": None},
    "screened_out": {"text": ["This study cannot be done on this device."], "completion_link": None},
    "lapsed": {"text": ["This study has all the participants it needs."], "completion_link": None},
    "paused": {
        **_driving("pickup", "spray_bottle", 6, False),
        "causes": ["connection"],
        "can_resume": True,
        "can_free": True,
        "text": "The connection was lost and the robot stopped. Go on when you are ready.",
    },
}


def session_row(participant: str, state: str, **changes: Any) -> Message:
    """A row of `GET /api/sessions`."""
    over = state in TERMINAL
    allowed = [] if over else ["experimenter_resume" if state == "paused" else "experimenter_pause", "abort"]
    why_not = dict.fromkeys(ACTS, "The session is over." if over else "")
    return {
        "participant": participant,
        "label": None,
        "demo": False,
        "state": state,
        "place": "trial" if state == "paused" else state,
        "causes": ["experimenter"] if state == "paused" else [],
        "trial": 1,
        "trials": 3,
        "condition": "balanced",
        "order": ["balanced", "teleoperation", "goal_oriented"],
        "pace": "real_time",
        "connected": not over,
        "held": False,
        "help_wanted": False,
        "done_tasks": 2 if state in ("trial", "paused") else None,
        "tasks": 6 if state in ("trial", "paused") else None,
        "round_trip_ms": 12.3,
        "overruns": 0,
        "frees": 0,
        "device": "gamepad",
        "created_utc": "2026-01-01T10:00:00Z",
        "allowed": allowed,
        "why_not": why_not,
        **changes,
    }
