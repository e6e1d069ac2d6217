"""`python -m tests.pythons.costs`: what each package of the lab takes of this environment, in MB, and for which extra.

A package is counted where it is first wanted: for serving alone, then for each extra.
"""

from __future__ import annotations

import importlib.metadata as metadata
from collections.abc import Iterator
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

LAB = "shared-autonomy-lab"
EXTRAS = ("", "bullet", "analysis", "meshes")
LEAST_MB = 1.0


def wanted(extra: str, known: set[str]) -> Iterator[str]:
    """The packages that are installed for an extra of the lab and are not known yet, which they then are."""
    waiting = [(LAB, extra)]
    while waiting:
        package, of = waiting.pop()
        for requirement in map(Requirement, metadata.requires(package) or ()):
            name = canonicalize_name(requirement.name)
            is_asked = requirement.marker is None or requirement.marker.evaluate({"extra": of})
            if of and package == LAB and "extra" not in str(requirement.marker):
                continue  # of the lab itself, whatever the extra
            if not is_asked or name in known:
                continue
            try:
                metadata.distribution(name)
            except metadata.PackageNotFoundError:
                continue
            known.add(name)
            yield name
            waiting += [(name, one) for one in ("", *requirement.extras)]


def size_mb(package: str) -> float:
    """Of its files that are there."""
    places = (Path(file.locate()) for file in metadata.files(package) or ())
    return sum(place.stat().st_size for place in places if place.is_file()) / 2**20


def main() -> None:
    """Print the table."""
    known: set[str] = set()
    for extra in EXTRAS:
        sizes = sorted(((size_mb(name), name) for name in wanted(extra, known)), reverse=True)
        print(f"{extra or 'serving'}: {sum(size for size, _ in sizes):.0f} MB in {len(sizes)} packages")
        for size, name in sizes:
            if size >= LEAST_MB:
                print(f"  {size:6.0f}  {name}")


if __name__ == "__main__":
    main()
