"""Distractors by their names: those that ship, those another package brings, and mistakes told by their line."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from app.trial import parts
from app.trial.parts import DISTRACTORS, REGISTRIES, make_distractor
from app.trial.world import open_study, parse_text
from study.definition.sections import DistractorSettings
from study.definition.study import StudyFileError
from study.flow.distractors.nback import NBack, NBackParameters
from study.flow.distractors.readings import ReadingParameters, Readings
from study.parts.errors import PartError
from tests.support.outside_package import DISTRACTOR, install_distractor

SOURCE = open_study(None).source_text
READINGS = "digits = 4\ndecimals = 1\n"


def with_kind(kind: str, fields: str = "") -> str:
    """The shipped study with another distractor and these fields of it."""
    assert READINGS in SOURCE
    return SOURCE.replace("[distractor]\n", f'[distractor]\nkind = "{kind}"\n').replace(READINGS, fields)


def problems(text: str) -> tuple[str, ...]:
    with pytest.raises(StudyFileError) as caught:
        parse_text(text, "mine.toml")
    return caught.value.problems


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of installed packages, on the path of this process, which has not looked for distractors yet."""
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "outside_distractors", raising=False)
    anew = type(DISTRACTORS)(DISTRACTORS.noun, DISTRACTORS.group, DISTRACTORS.shipped, DISTRACTORS.methods)
    monkeypatch.setattr(parts, "REGISTRIES", {**REGISTRIES, "distractor": anew})
    return tmp_path


def test_a_study_that_names_no_kind_has_the_papers_readings() -> None:
    settings = open_study(None).distractor
    made = make_distractor(settings)
    assert isinstance(made, Readings) and made.parameters == ReadingParameters(4, 1)
    without = SOURCE[: SOURCE.index("[distractor]")] + SOURCE[SOURCE.index("[quality]") :]
    same = make_distractor(parse_text(without, "mine.toml").distractor)
    assert type(same) is Readings and same.parameters == made.parameters


def test_a_study_may_name_n_back_with_its_own_fields() -> None:
    study = parse_text(with_kind("nback", "n = 3\ntarget_rate = 1\n"), "mine.toml")
    made = make_distractor(study.distractor)
    assert isinstance(made, NBack)
    assert made.parameters == NBackParameters(n=3, target_rate=1.0)
    assert made.settings.placement == "same_page_away"


@pytest.mark.parametrize(
    ("text", "line", "sentence"),
    [
        (
            with_kind("nbakc"),
            'distractor.kind = "nbakc"',
            "not known; did you mean 'nback'? distractors: readings, nback, or your own as file.py:Class in a file "
            "beside this one",
        ),
        (
            with_kind("nback", "digits = 4\n"),
            "distractor.digits = 4",
            "unknown field; fields here: enabled, kind, first_s",
        ),
        (with_kind("nback", "n = 0\n"), "distractor.n = 0", "must be a whole number at least 1 and at most 5"),
        (with_kind("nback", "n = true\n"), "distractor.n = true", "at least 1 and at most 5, not true or false"),
        (with_kind("nback", "target_rate = nan\n"), "distractor.target_rate = nan", "must be a number at least 0.0"),
        (with_kind("nback", 'letters = "A"\n'), 'distractor.letters = "A"', "must have at least 2 characters"),
        (
            with_kind("nback", f'letters = "{"A" * 27}"\n'),
            f'distractor.letters = "{"A" * 27}"',
            "must have at most 26 characters",
        ),
        (with_kind("nback", 'letters = "AaB"\n'), 'distractor.letters = "AaB"', "must be letters or digits, each of"),
        (
            with_kind("nback", "taget_rate = 0.5\n"),
            "distractor.taget_rate = 0.5",
            "unknown field; did you mean 'target_rate'? fields here: enabled, kind, first_s, every_s, answer_within_s, "
            "placement, away_min_s, n, letters, target_rate",
        ),
        (
            SOURCE.replace("digits = 4", "digits = 1"),
            "distractor.decimals = 1",
            "must be below digits, which is 1",
        ),
        (SOURCE.replace("digits = 4", "parameters = 4"), "distractor.parameters = 4", "unknown field; fields here"),
        (SOURCE.replace("first_s = 10.0", "kind = 7"), "distractor.kind = 7", "must be a text, not a whole number"),
    ],
)
def test_a_mistake_in_the_table_is_told_with_its_line(text: str, line: str, sentence: str) -> None:
    number = 1 + next(
        place for place, read in enumerate(text.splitlines()) if read.startswith(line.removeprefix("distractor."))
    )
    (problem,) = problems(text)
    assert problem.startswith(f"mine.toml:{number}: {line}: ")
    assert sentence in problem


def test_all_mistakes_are_told_at_once() -> None:
    text = with_kind("nback", "n = 9\nletters = 5\n").replace("first_s = 10.0", "first_s = -1.0")
    assert [problem.split(": ")[1].split(" ")[0] for problem in problems(text)] == [
        "distractor.first_s",
        "distractor.n",
        "distractor.letters",
    ]


def test_another_package_brings_a_distractor(site: Path) -> None:
    install_distractor(site, {"sums": "outside_distractors:Sums"})
    study = parse_text(with_kind("sums", "most = 3\n"), "mine.toml")
    made = make_distractor(study.distractor)
    assert type(made).__name__ == "Sums"
    assert made.stimulus(5, 1, 1).prompt == "Type the sum, then press Enter"
    (problem,) = problems(with_kind("sums", "most = 100\n"))
    assert "distractor.most = 100: must be a whole number at least 1 and at most 99" in problem
    (problem,) = problems(with_kind("sum"))
    assert "did you mean 'sums'? distractors: readings, nback, sums" in problem


HALF = "class Half:\n    def stimulus(self): ...\n    def is_right(self): ..."


@pytest.mark.parametrize(
    ("place", "source", "sentence"),
    [
        ("nowhere:Sums", DISTRACTOR, "'mine' (nowhere:Sums) cannot be loaded: ModuleNotFoundError"),
        ("outside_distractors:Missing", DISTRACTOR, "cannot be loaded: AttributeError"),
        ("outside_distractors:Sums", "1 / 0", "cannot be loaded: ZeroDivisionError"),
        ("outside_distractors:Half", HALF, "lacks Parameters, due_s, deadline_s, right_answer, simulated_answer"),
        (
            "outside_distractors:Sums",
            DISTRACTOR.replace("def right_answer", "def best_answer"),
            "lacks right_answer; it must have Parameters, due_s",
        ),
        ("outside_distractors:Sums", DISTRACTOR.replace("(frozen=True)", ""), "must be a frozen dataclass"),
        ("outside_distractors:Sums", DISTRACTOR.replace("most:", "kind:"), "'kind' of outside_distractors.SumP"),
        (
            "outside_distractors:Sums",
            DISTRACTOR.replace("25.0 * (number - 1)", "0.0"),
            "stimulus 1 is due at 6.0 s",
        ),
    ],
)
def test_a_distractor_that_cannot_be_used_is_one_line_of_the_check(
    site: Path, place: str, source: str, sentence: str
) -> None:
    install_distractor(site, {"mine": place}, source)
    (problem,) = problems(with_kind("mine"))
    assert problem.startswith("mine.toml:")
    assert 'distractor.kind = "mine": ' in problem
    assert sentence in problem
    assert "\n" not in problem


def test_a_distractor_that_cannot_be_made_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*given: object) -> None:
        raise ValueError("not today")

    monkeypatch.setattr(Readings, "__init__", refuse)
    with pytest.raises(PartError, match=r"distractor 'readings' cannot be made: ValueError: not today"):
        make_distractor(DistractorSettings())


def test_the_questionnaire_speaks_of_readings_only_where_there_are_some() -> None:
    def intros(text: str) -> str:
        return " ".join(form.intro for form in parse_text(text, "mine.toml").instruments)

    assert "both moving the objects and logging the readings." in intros(SOURCE)
    assert "both moving the objects and the other task." in intros(with_kind("nback"))
