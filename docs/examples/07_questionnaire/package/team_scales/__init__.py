"""A questionnaire as an installed package brings it: the entry point names a file, or a text of the same form."""

from pathlib import Path

TEAMWORK = Path(__file__).with_name("teamwork.toml")
