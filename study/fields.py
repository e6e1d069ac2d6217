"""Kinds of fields that the study file and the files beside it share."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field

Text = Annotated[str, Field(min_length=1, strict=True)]
Identifier = Annotated[str, Field(min_length=1, max_length=40, pattern=r"^[a-z0-9][a-z0-9_]*$", strict=True)]
Paragraphs = Annotated[tuple[Text, ...], Field(min_length=1)]
Flag = Annotated[bool, Field(strict=True)]


def number(**bounds: Any) -> Any:
    """A number that is one (no text, no NaN), within pydantic's `ge`, `gt`, `le`, `lt`."""
    return Field(strict=True, allow_inf_nan=False, **bounds)


class Part(BaseModel):
    """A table of the file: every key is known, nothing changes afterwards."""

    model_config = ConfigDict(extra="forbid", frozen=True)
