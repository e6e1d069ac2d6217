"""`salab new` and `salab check`: a study file made, and everything wrong with one told."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.commands import options
from app.commands.console import shown
from app.commands.groups import STUDY_FILE
from app.commands.options import choice
from app.commands.participant_texts import notes_on_texts
from app.errors import LabError
from app.simulated.presets import PRESET_NAMES
from study.extras import missing_extra

if TYPE_CHECKING:
    from sim.layouts import Layout
    from study.definition.study import Study
    from study.parts.code import Code

commands = typer.Typer()


@commands.command(rich_help_panel=STUDY_FILE, epilog="Example: salab new my-study --preset fitted")
def new(
    name: Annotated[
        str,
        typer.Argument(
            metavar="NAME", show_default=False, help="name of the study, or of the file: pilot makes pilot.toml"
        ),
    ] = "",
    preset: Annotated[
        str,
        choice(
            PRESET_NAMES,
            "arbiter, arm, layout and place of the readings: those of the study that ships, or another set that is "
            "known by name",
        ),
    ] = "shipped",
    arbiter: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="also write an arbiter of your own to change, with its test and a condition"),
    ] = None,
) -> None:
    """Write a commented study file to change."""
    given, name = name, (name or arbiter or "").strip()
    file = Path(name if name.endswith(".toml") else f"{name}.toml")
    title = re.sub(r"[-_\s]+", " ", file.stem).strip()
    if not name or not title or not name.isprintable():
        raise LabError(f"{given!r} is no name for a study; give one such as my-study")
    text = new_study_text(title[0].upper() + title[1:], file, preset)
    if arbiter is not None:
        _write_with_arbiter(file, text, arbiter)
        return
    _write({file: text})
    print(
        f"wrote {file}: the paper's study, with every setting explained. Next:\n"
        f"  change it in an editor\n"
        f"  salab check {file}\n"
        f"  salab simulate --study {file} --participants 2 --out {file.stem}-pilot\n"
        f"  salab serve --study {file}"
    )


@commands.command(rich_help_panel=STUDY_FILE, epilog="Example: salab check my-study.toml")
def check(
    file: Annotated[Path, typer.Argument(metavar="FILE", parser=options.place, help="the study file")],
    trust: Annotated[bool, options.trust()] = False,
    picture: Annotated[
        Path | None,
        typer.Option(
            metavar="PICTURE",
            parser=options.place,
            help="where to draw the layout: a .png, .svg or .pdf; beside the study file if not given",
        ),
    ] = None,
) -> int:
    """Tell every problem of a study file at once, and draw its layout.

    Of a file without one it tells how long a participant takes and how well the arbiter's weight balances.
    """
    from app.trial.setup import calibration_text, study_setup
    from app.trial.world import drafted_layout, layout_of, open_study
    from study.definition.layouts import shipped_layouts
    from study.definition.study import StudyFileError
    from study.flow.overview import overview

    try:
        study = open_study(file, trust)
    except StudyFileError as error:
        for problem in error.problems:
            print(shown(problem), file=sys.stderr)
        draft = drafted_layout(file)
        if draft is not None and (picture is not None or draft.name not in shipped_layouts()):
            _draw(draft, file, picture)
        count = len(error.problems)
        print(shown(f"{file}: {count} problem{'' if count == 1 else 's'}"), file=sys.stderr)
        return 1
    print(shown(f"{file}: fine. {overview(study)}. SHA-256 {study.hash}"))
    for line in notes_on_texts(study, file):
        print(shown(line))
    for line in notes_on_look(study):
        print(line)
    held = held_codes(file)
    for code in study.codes:
        print(code_line(code, trust, file.parent, code in held))
    if any(code.is_beside for code in study.codes) and not trust:
        print(f"Not run, and so not checked: that code. Read it, then: salab check {file} --trust")
        _draw(layout_of(study), file, picture)
        return 0
    setup = study_setup(study, trust)
    if setup.calibration is not None:
        print(calibration_text(setup.calibration))
    _draw(setup.layout, file, picture)
    return 0


def notes_on_look(study: Study) -> Iterator[str]:
    """What is to be known of how the robot would be drawn on this machine."""
    from app.trial.robots import look_here, why_no_look

    if missing := why_no_look(study.view):
        yield f"It cannot be served on this machine: {missing}."
    if study.view.look == "installed":
        yield (
            f"It leaves open how the robot looks (on this machine: {look_here(study.view)}). Under [view], "
            'look = "own" or "published" shows everybody the same.'
        )


def _write_with_arbiter(file: Path, study_text: str, arbiter: str) -> None:
    from app.commands.skeleton import arbiter_files, with_condition

    beside = {file.parent / name: text for name, text in arbiter_files(arbiter).items()}
    _write({**beside, file: with_condition(study_text, arbiter)})
    source, test = beside
    print(
        f"wrote {source}, an arbiter to change, {test}, and {file}: the paper's study with it as a fourth condition. "
        "Next:\n"
        f"  change {source} in an editor\n"
        f"  pytest {test}    (pip install pytest, if there is none)\n"
        f"  salab check {file} --trust\n"
        f"  salab simulate --study {file} --trust --participants 2 --out {file.stem}-pilot\n"
        f"  salab serve --study {file} --trust"
    )


def _write(texts: Mapping[Path, str]) -> None:
    """All of these files, none of which may be there. Raises `LabError`, and has written nothing then."""
    for file in texts:
        if file.exists():
            raise LabError(f"{file}: there already; choose another name, or remove it first")
    written: list[Path] = []
    try:
        for file, text in texts.items():
            with file.open("x", encoding="utf-8", newline="\n") as made:
                written.append(file)
                made.write(text)
    except OSError as error:
        for path in written:
            path.unlink()
        raise LabError(f"{file}: cannot be written: {error.strerror or error}") from None


def code_line(code: Code, trust: bool, folder: Path, is_held: bool) -> str:
    """What a study would run that does not ship with the lab, and where it is to be read.

    `is_held`: the study file in `folder` holds the source itself, and a file beside it is not what runs.
    """
    runs = "runs" if trust or not code.is_beside else "would run"
    return f"{runs} {code.kind} {code.name} from {_source(code, folder, is_held)}, SHA-256 {code.sha256}"


def _source(code: Code, folder: Path, is_held: bool) -> str:
    from study.parts.code import code_beside, file_of
    from study.parts.errors import PartError

    if not code.is_beside:
        return code.from_package
    size = sum(len(text.encode()) for text in code.files.values())
    if not is_held:
        return f"{size} bytes beside the study file"
    inside = f"{size} bytes inside the study file, in its table [[code]]"
    beside = file_of(code.name)
    if not (folder / beside).exists():
        return inside
    try:
        differs = code_beside(code.kind, code.name, folder).sha256 != code.sha256
    except PartError:
        differs = True
    return f"{inside}, not from {beside} beside it, which differs" if differs else inside


def held_codes(file: Path) -> tuple[Code, ...]:
    """The sources that a study file holds itself."""
    from study.definition.files_beside import MOST_STUDY_BYTES
    from study.definition.named_parts import codes_of
    from study.definition.toml_reader import parse_toml
    from study.text_file import read_text

    return codes_of(parse_toml(read_text(file, MOST_STUDY_BYTES).encode(), str(file))[0])


PICTURES = (".png", ".svg", ".pdf")


def _draw(layout: Layout, file: Path, picture: Path | None) -> None:
    """Draw the layout beside the study file, or where one asked for it, and say where that is."""
    try:
        from app.report.layout_picture import write_layout_picture
    except ModuleNotFoundError as error:
        what = missing_extra(error)
        if what is None or picture is not None:
            raise
        print(f"layout {layout.name!r} is not drawn: that {what}")
        return
    target = picture or file.with_suffix(".layout.png")
    if target.suffix.lower() not in PICTURES:
        raise LabError(f"--picture {target}: a picture's name ends in {', '.join(PICTURES)}")
    try:
        if target.is_symlink() or not (target.is_file() or target.is_dir() or not target.exists()):
            # Whoever sent the study file may have sent the link as well, and what it leads to would be replaced.
            raise OSError("a link, or no regular file, is not written to")
        write_layout_picture(layout, target)
    except OSError as error:
        if picture is not None:
            raise LabError(f"{target}: cannot be written: {error.strerror or error}") from None
        print(f"layout {layout.name!r} is not drawn: {target} cannot be written: {error.strerror or error}")
        return
    print(f"layout {layout.name!r} is drawn in {target}")


def new_study_text(title: str, file: Path, preset: str) -> str:
    """The paper's study with another title and a preset's coefficients, its comments naming the file."""
    from app.simulated.variants import changed_study, preset_changes
    from app.trial.world import open_study

    text = changed_study(open_study(None), preset_changes(preset)).source_text
    text = re.sub(r"^title = .*$", lambda _: f"title = {json.dumps(title, ensure_ascii=False)}", text, flags=re.M)
    return text.replace("my-study.toml", file.name)
