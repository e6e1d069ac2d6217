"""Kinds of fields that the study file and the files beside it share."""

from __future__ import annotations

import re
from typing import Annotated, Any

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field
from pydantic_core import PydanticCustomError

LINK = re.compile(r"https?://[^\s/?#@]+(?:[/?#]\S*)?\Z")


def _link(value: object) -> object:
    if isinstance(value, str) and (value == "" or LINK.match(value)):
        return value
    raise PydanticCustomError("link", 'must be a link that begins with https:// or http://, or "" for none')


Text = Annotated[str, Field(min_length=1, strict=True)]
Label = Annotated[str, Field(min_length=1, max_length=80, strict=True)]
Identifier = Annotated[str, Field(min_length=1, max_length=40, pattern=r"^[a-z0-9][a-z0-9_]*$", strict=True)]
Paragraphs = Annotated[tuple[Text, ...], Field(min_length=1)]
Flag = Annotated[bool, Field(strict=True)]
Link = Annotated[str, BeforeValidator(_link)]
ParameterName = Annotated[str, Field(min_length=1, max_length=40, pattern=r"^[A-Za-z][A-Za-z0-9_-]*$", strict=True)]
"""What a parameter in a link is called, such as PROLIFIC_PID."""
PART_NAME = r"^(?:[A-Za-z0-9][A-Za-z0-9_.-]*|[A-Za-z_][A-Za-z0-9_]*\.py:[A-Za-z_][A-Za-z0-9_]*)$"
PartName = Annotated[str, Field(min_length=1, max_length=100, pattern=PART_NAME, strict=True)]
"""A part's name, or `file.py:Class` for one in a file beside the study file."""


def number(**bounds: Any) -> Any:
    """A number that is one (no text, no NaN), within pydantic's `ge`, `gt`, `le`, `lt`."""
    return Field(strict=True, allow_inf_nan=False, **bounds)


class Part(BaseModel):
    """A table of the file: every key is known, nothing changes afterwards."""

    model_config = ConfigDict(extra="forbid", frozen=True)
