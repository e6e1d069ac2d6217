"""What the participants of a study were asked, as an export tells it: items, anchors, direction and scoring."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from study.instruments import INSTRUMENTS


def asked(data: Mapping[str, Any]) -> dict[str, Any]:
    """Questionnaires and forms of a study file's data, as JSON; parts that the file does not have are empty.

    Answers stand in `survey_answers` under the `id` of the questionnaire (or form) and of the item.
    """
    instructions, texts = _table(data, "instructions"), _table(data, "texts")
    return {
        "surveys": [_survey(name) for name in data.get("surveys", ()) if name in INSTRUMENTS],
        "demographics": data.get("demographics", []),
        "comprehension": instructions.get("questions", []),
        "debrief": texts.get("debrief_questions", []),
    }


def _survey(name: str) -> dict[str, Any]:
    form = asdict(INSTRUMENTS[name])
    for item in form["items"]:
        item["anchors"] = {"1": item.pop("low"), str(form["points"]): item.pop("high")}
    return form


def _table(data: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    found = data.get(key)
    return found if isinstance(found, Mapping) else {}
