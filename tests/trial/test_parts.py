"""Parts of strangers: files that are none, and packages whose entry points are unusual or broken."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from app.commands.study_file import code_line
from study.parts.code import MAX_SOURCE_BYTES, Code, code_beside, code_of_package, load
from study.parts.errors import PartError, one_line
from study.parts.registry import Registry
from tests.support.outside_package import install

SOURCE = "class Outer:\n    class Inner:\n        def run(self): ...\n"


def registry() -> Registry:
    """A kind of part of which one ships."""
    return Registry(noun="part", group="salab.test_parts", shipped={"own": "json:JSONDecoder"}, methods=())


def refusal(folder: Path) -> str:
    with pytest.raises(PartError) as caught:
        code_beside("part", "blend.py:Blend", folder)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_a_link_a_pipe_and_a_folder_are_not_read(tmp_path: Path) -> None:
    file = tmp_path / "blend.py"
    inside = tmp_path / "inside"
    inside.mkdir()
    (tmp_path / "secret.py").write_text(SOURCE, encoding="utf-8")
    (inside / "blend.py").symlink_to("../secret.py")
    assert "blend.py is a link that leads out of its folder; put the file itself there" in refusal(inside)
    file.symlink_to("secret.py")
    assert code_beside("part", "blend.py:Blend", tmp_path).files == {"blend.py": SOURCE}
    file.unlink()
    os.mkfifo(file)
    assert "blend.py is no regular file" in refusal(tmp_path)
    file.unlink()
    file.mkdir()
    assert "blend.py is a folder, not a file" in refusal(tmp_path)


def test_a_source_may_begin_with_a_byte_order_mark_and_has_a_bound(tmp_path: Path) -> None:
    file = tmp_path / "blend.py"
    file.write_bytes(SOURCE.encode("utf-8-sig"))
    assert code_beside("part", "blend.py:Blend", tmp_path).files == {"blend.py": SOURCE}
    file.write_bytes(b"#" * MAX_SOURCE_BYTES)
    assert len(code_beside("part", "blend.py:Blend", tmp_path).files["blend.py"]) == MAX_SOURCE_BYTES
    file.write_bytes(b"#" * (MAX_SOURCE_BYTES + 1))
    assert refusal(tmp_path).endswith("blend.py is larger than 1 MB, the most that is read")


@pytest.mark.parametrize(
    ("place", "name"),
    [("outer_a:Outer", "Outer"), ("outer_a:Outer.Inner", "Inner"), ("outer_a : Outer [fast,  slow]", "Outer")],
)
def test_every_legal_entry_point_leads_to_its_class(
    place: str, name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    install(tmp_path, {"theirs": place}, SOURCE, group="salab.test_parts", module="outer_a")
    monkeypatch.syspath_prepend(tmp_path)
    parts = registry()
    assert parts.load("theirs").__name__ == name
    assert parts.module_of("theirs") == "outer_a"
    code = code_of_package("part", "theirs", parts.registered["theirs"])
    assert (code.files, code.package, code.version) == ({"outer_a.py": SOURCE}, "outer-a", "1.0")
    assert load(code, parts).__name__ == name


def test_a_package_without_a_name_is_one_all_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install(tmp_path, {"theirs": "outer_b:Outer"}, SOURCE, group="salab.test_parts", module="outer_b")
    (tmp_path / "outer_b-1.0.dist-info" / "METADATA").write_text("", encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    code = code_of_package("part", "theirs", registry().registered["theirs"])
    assert (code.package, code.version) == ("", "")
    said = f"runs part theirs from a package without a name, SHA-256 {code.sha256}"
    assert code_line(code, False, tmp_path, is_held=False) == said


def test_entry_points_that_cannot_be_read_are_one_line_and_in_no_shipped_parts_way(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    install(tmp_path, {"theirs": "outer_c:Outer"}, SOURCE, group="salab.test_parts", module="outer_c")
    (tmp_path / "outer_c-1.0.dist-info" / "entry_points.txt").write_bytes(b"[salab.test_parts]\n\xff = a:b\n")
    monkeypatch.syspath_prepend(tmp_path)
    parts = registry()
    assert parts.load("own").__name__ == "JSONDecoder"
    with pytest.raises(PartError) as caught:
        parts.load("theirs")
    told = str(caught.value)
    assert told.startswith("what is installed cannot be read: entry_points.txt of outer-c (UnicodeDecodeError: ")
    assert told.endswith("; mend or uninstall it") and "\n" not in told


def test_what_a_study_file_says_of_a_package_stays_on_one_line(tmp_path: Path) -> None:
    code = Code("part", "theirs", "0" * 64, {}, "numpy\nmine.toml: fine", "1\x1b[2J")
    assert code_line(code, False, tmp_path, is_held=True) == (
        f"runs part theirs from numpy mine.toml: fine 1?[2J, SHA-256 {'0' * 64}"
    )


class Unspeakable(Exception):
    def __str__(self) -> str:
        raise SystemExit(3)


@pytest.mark.parametrize(
    ("error", "told"),
    [
        (ValueError("two\n\t lines"), "two lines"),
        (ValueError("a\x07b\ud800c"), "a?b?c"),
        (ValueError("x" * 301), "x" * 299 + "…"),
        (Unspeakable(), "an error that cannot be told (SystemExit)"),
    ],
)
def test_whatever_an_error_says_is_one_line(error: Exception, told: str) -> None:
    assert one_line(error) == told
