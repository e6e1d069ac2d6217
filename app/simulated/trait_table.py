"""The traits as the documentation shows them (`docs/topics/simulated-participants.md`): one row each, with its source.

python -m app.simulated.trait_table
"""

from __future__ import annotations

from app.simulated.traits import TRAITS


def trait_table() -> str:
    """A Markdown table: the mean (or that it is fitted, and stands in `fitted.json`), spread, meaning and source."""
    rows = ["| trait | mean | spread | meaning | source |", "|---|---|---|---|---|"]
    for name, trait in TRAITS.items():
        mean = "fitted" if trait.fitted else f"{trait.mean:g}"
        rows.append(f"| `{name}` | {mean} | {trait.spread:g} | {trait.about} | {trait.source} |")
    return "\n".join(rows)


if __name__ == "__main__":
    print(trait_table())
