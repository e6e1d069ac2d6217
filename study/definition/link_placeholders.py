"""Names in braces in a link, and what is put in their place."""

from __future__ import annotations

import re
from collections.abc import Mapping

_PLACEHOLDER = re.compile(r"\{([^{}]*)\}")


def placeholders(link: str) -> tuple[str, ...]:
    """The names that stand in braces in a link."""
    return tuple(_PLACEHOLDER.findall(link))


def filled(link: str, ids: Mapping[str, str]) -> str | None:
    """The link with its placeholders replaced; None when there is no link, or an id it needs is not known."""
    if not link or any(name not in ids for name in placeholders(link)):
        return None
    return _PLACEHOLDER.sub(lambda found: ids[found.group(1)], link)
