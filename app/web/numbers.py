"""Whole numbers that come with a request, each with bounds: SQLite takes 64 bits, and JSON's readers 53 of them."""

from __future__ import annotations

from typing import Annotated

from fastapi import Path, Query

MOST = 2**53 - 1
"""The largest whole number that every reader of JSON takes as it is."""

TrialNumber = Annotated[int, Path(ge=1, le=MOST, description="Number of the trial, from 1.")]
Offset = Annotated[int, Query(ge=0, le=MOST, description="How many to pass over.")]
Limit = Annotated[int, Query(ge=1, le=500, description="How many to send at most.")]
