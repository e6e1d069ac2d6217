"""README, CONTRIBUTING and the pages in docs, held to what exists: what they name is there, what is there they name.

What is told of a whole class of things (every key, column, route, message, option) stands in pages made from the code;
these are held to the code here too. `test_site` builds the site.
"""

from __future__ import annotations

import dataclasses
import json
import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any, get_args

import pytest
import yaml
from pydantic import BaseModel, TypeAdapter

from app.commands import described
from app.commands.program import program
from app.config import LabConfig
from app.contracts.plugin import SUITES
from app.limits import Limits
from app.trial.parts import shelf
from app.trial.world import world_problems
from app.wire import (
    CLIENT_MESSAGE,
    MAX_MESSAGE_BYTES,
    AlertChoice,
    ClientMessage,
    Note,
    ServerMessage,
    StimulusWords,
    Submit,
)
from docs import reference, words
from study.definition.layouts import LayoutFile, in_use
from study.definition.named_parts import part_problems
from study.definition.part_fields import model_of
from study.definition.questionnaires import QuestionnaireFile, QuestionnaireItem, file_problems
from study.definition.study import Study
from study.definition.toml_reader import model_problems
from study.flow.flow import FLOW
from study.flow.notes import NOTES
from study.flow.protocol import TERMINAL
from study.flow.steps import STEP_DATA
from study.records import TABLES, codebook

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
PICTURES = DOCS / "pictures"
MAX_PICTURE_BYTES = 150_000
MAX_README_BYTES = 8192

PATHS = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(DOCS.rglob("*.md"))]
PAGES = {str(path.relative_to(ROOT)): path.read_text(encoding="utf-8") for path in PATHS}
"""As they are written: without what is made from the code."""
FENCE = re.compile(r"^ *```([\w{}]*)[^\n]*\n(.*?)^ *```$", re.MULTILINE | re.DOTALL)


def blocks(kind: str, text: str) -> list[str]:
    """The code blocks of a kind."""
    return [found[2] for found in FENCE.finditer(text) if found[1] == kind]


def spans_of(text: str) -> list[str]:
    """What stands between single backticks."""
    return re.findall(r"(?<!`)`([^`\n]+)`(?!`)", FENCE.sub("", text))


ALL = "\n".join(PAGES.values())
SHELL = [line for text in blocks("sh", ALL) for line in text.replace("\\\n", " ").splitlines()]
SPANS = spans_of(ALL)
CODE = [*SHELL, *SPANS]
COMMANDS = {command.name: command for command in described()}


def options_of(command: str) -> set[str]:
    return {flag for option in COMMANDS[command].options for flag in option.flags if flag.startswith("--")}


def used(command: str) -> list[str]:
    """What follows `salab command` wherever it is used."""
    return [match.group(1) for text in CODE for match in re.finditer(rf"\bsalab {command}\b([^#&|]*)", text)]


def rows_of(table: str) -> list[list[str]]:
    """The cells of every row of a page's tables, their heads included."""
    lines = [line for line in table.splitlines() if line.startswith("| ")]
    return [[cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]] for line in lines]


# ---- commands, options, settings, targets


def test_every_subcommand_named_exists_and_every_one_is_named() -> None:
    named = {match for text in CODE for match in re.findall(r"\bsalab ([a-z][a-z0-9-]*)", text)}
    named |= {span for span in SPANS if span in COMMANDS}
    assert named == set(COMMANDS)


@pytest.mark.parametrize("command", sorted(COMMANDS))
def test_every_option_used_exists(command: str) -> None:
    wrong = {o for rest in used(command) for o in re.findall(r"--[a-z-]+", rest)} - options_of(command) - {"--help"}
    assert not wrong, f"salab {command} has no {', '.join(sorted(wrong))}"


EXAMPLES = [line for line in SHELL if re.search(r"\bsalab [a-z]", line)]


@pytest.mark.parametrize("line", EXAMPLES)
def test_every_example_of_a_command_can_be_typed(line: str) -> None:
    name, *arguments = shlex.split(re.split(r"\bsalab ", line)[1].removesuffix("&"), comments=True)
    assert program().commands[name].make_context(name, arguments).params


def test_every_option_mentioned_by_itself_exists_somewhere() -> None:
    known = {option for command in COMMANDS for option in options_of(command)} | {"--help", "--version"}
    known |= {"--pyargs", "--parameters", *(f"--{kind}" for kind in SUITES.values())}  # of pytest, for the contracts
    mentioned = {match for span in SPANS for match in re.findall(r"(?<![\w-])--[a-z][a-z-]*", span)}
    assert mentioned <= known


def test_every_option_of_every_command_is_documented_with_its_default() -> None:
    page = reference.command_line()
    for command in COMMANDS.values():
        part = page.split(f"# `salab {command.name}`\n")[1].split("\n#")[0]
        rows = {tuple(re.findall(r"`([^`]+)`", row[0])): row for row in rows_of(part)}
        assert all(words.sentence(said) in part for said in command.help.split("\n\n") if said)
        assert f"```sh\n{command.example}\n```" in part
        for option in command.options:
            _, _, default, meaning = rows[option.flags or (option.metavar,)]
            assert option.help, f"salab {command.name} {option.flags or option.metavar} has no help"
            assert meaning == words.cell(words.sentence(option.help))
            assert default == ("must be given" if option.required else f"`{option.default}`" if option.default else "")


def test_every_setting_is_documented_with_its_option_and_default() -> None:
    rows = {row[0].strip("`"): row for row in rows_of(reference.settings())[1:]}
    assert list(rows) == [field.name for field in dataclasses.fields(LabConfig)]
    assert {row[1].strip("`") for row in rows.values()} - {""} == options_of("serve") - reference.BESIDE_ANOTHER
    for field in dataclasses.fields(LabConfig):
        _, option, default, meaning = rows[field.name]
        assert default.strip("`") == ("" if field.default in (None, (), dataclasses.MISSING) else str(field.default))
        assert meaning, field.name
        described = next((o for o in COMMANDS["serve"].options if option.strip("`") in o.flags), None)
        if described is not None and described.default and default:
            assert described.default == str(field.default), option


def test_every_bound_is_documented_with_its_default() -> None:
    rows = {row[0].strip("`"): row[1:] for row in rows_of(reference.limits())[1:]}
    assert list(rows) == [field.name for field in dataclasses.fields(Limits)]
    for field in dataclasses.fields(Limits):
        default, meaning = rows[field.name]
        assert default == f"`{field.default}`" and meaning, field.name


def test_every_variable_of_the_environment_is_told() -> None:
    sources = "\n".join(path.read_text(encoding="utf-8") for path in (ROOT / "app").rglob("*.py"))
    in_code = set(re.findall(r"\bSALAB_[A-Z_]+", sources))
    assert set(re.findall(r"\bSALAB_[A-Z_]+", ALL)) == in_code
    told = set(re.findall(r"^\| `([A-Z_]+)` \|", PAGES["docs/reference/settings.md"], re.MULTILINE))
    assert told >= in_code


def test_every_make_target_named_exists_and_every_one_is_named() -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    targets = set(re.findall(r"^([a-z-]+):.*## ", makefile, re.MULTILINE)) - {"help"}
    assert {match for text in CODE for match in re.findall(r"\bmake ([a-z-]+)", text)} == targets


# ---- the API and the wire


def test_every_route_named_exists() -> None:
    paths = reference.openapi()["paths"]
    found = 0
    for row in re.findall(r"^\| ((?:`[^`]+`,? ?)+) \|", ALL, re.MULTILINE):
        spans = re.findall(r"`([^`]+)`", row)
        first: list[str] = spans[0].split()
        if first[0] not in ("GET", "POST"):
            continue
        base = first[1].rpartition("/")[0]
        for span in spans:
            method, path = span.split() if " " in span else (first[0], f"{base}/{span}")
            assert method.lower() in paths.get(path, {}), f"there is no {method} {path}"
            found += 1
    assert found > 8
    for span in SPANS:
        if route := re.fullmatch(r"(GET|POST|DELETE) (/\S+)", span):
            assert route[1].lower() in paths.get(route[2], {}), f"there is no {span}"


def test_every_route_and_everything_sent_is_in_the_reference() -> None:
    page, described = reference.http_api(), reference.openapi()
    for path, methods in described["paths"].items():
        for method, route in methods.items():
            part = page.split(f"## `{method.upper()} {path}`\n")[1].split("\n## ")[0]
            assert route["description"] in part
    anchors = {heading.lower() for heading in re.findall(r"^### (\w+)$", page, re.MULTILINE)}
    assert set(re.findall(r"\]\(#(\w+)\)", page)) <= anchors
    for name, schema in described["components"]["schemas"].items():
        part = page.split(f"### {name.lstrip('_')}\n")[1].split("\n### ")[0]
        assert [row[0].strip("`") for row in rows_of(part)[1:]] == list(schema.get("properties", {}))


@pytest.mark.parametrize("page", ["http_api", "wire_protocol"])
def test_everything_that_is_sent_says_what_it_means(page: str) -> None:
    """Each table's last column is the meaning: of a parameter, a field, a key."""
    rows = rows_of(reference.GENERATED[page]())
    assert len(rows) > 70
    assert {row[-1] for row in rows if row[0] in ("parameter", "field", "key")} == {"meaning"}
    assert [row[0] for row in rows if not row[-1]] == []


def test_every_message_and_field_of_the_wire_is_in_the_reference() -> None:
    page = reference.wire_protocol()
    for union in (ClientMessage, ServerMessage):
        for model in reference.messages(union):
            name = model.model_fields["type"].default
            part = page.split(f"### `{name}`\n")[1].split("\n##")[0]
            assert part.strip().startswith((model.__doc__ or "").split("\n")[0])
            assert {row[0].strip("`") for row in rows_of(part)[1:]} == set(model.model_fields) - {"type"}
    for inner in (AlertChoice, StimulusWords):
        part = page.split(f"### `{inner.__name__}`\n")[1].split("\n##")[0]
        assert [row[0].strip("`") for row in rows_of(part)[1:]] == list(inner.model_fields)
        assert all(row[-1] for row in rows_of(part))


def test_every_note_of_a_page_is_in_the_reference_with_who_may_say_it() -> None:
    assert set(get_args(Note.model_fields["name"].annotation)) == set(NOTES)
    page = reference.wire_protocol().split("## What a note holds\n")[1].split("\n## ")[0]
    told = {row[0].strip("`"): row for row in rows_of(page)[1:]}
    assert set(told) == set(NOTES)
    for name, note in NOTES.items():
        assert told[name][1] == ", ".join(note.roles)
        assert all(field in told[name][2] for field in note.data.model_fields)


def test_every_step_of_a_submit_is_in_the_reference_with_what_it_holds() -> None:
    assert set(get_args(Submit.model_fields["step"].annotation)) == set(STEP_DATA)
    page = reference.wire_protocol().split("## What a submit holds\n")[1]
    for step, model in STEP_DATA.items():
        (part,) = (part for part in page.split("\n### ") if f"`{step}`" in part.splitlines()[0])
        assert [row[0].strip("`") for row in rows_of(part)[1:]] == list(model.model_fields)


def test_the_dialogue_of_a_client_is_what_can_be_said() -> None:
    """What is sent is whole; what is received is shortened, but of a known type with known fields."""
    (dialogue,) = (text for text in blocks("text", PAGES["docs/how-to/drive-headless.md"]) if '"hello"' in text)
    known = {model.model_fields["type"].default: model for model in reference.messages(ServerMessage)}
    said = 0
    for line in dialogue.splitlines():
        if line.startswith("> "):
            message = CLIENT_MESSAGE.validate_json(line[2:])
            if isinstance(message, Submit):
                STEP_DATA[message.step].model_validate(message.data)
            said += 1
        elif line.startswith("< "):
            fields = json.loads(line[2:].replace(", ...}", "}").replace("{...}", "{}"))
            assert set(fields) <= set(known[fields["type"]].model_fields), line
        else:
            assert line == "..."
    assert said == 4
    assert f"at most {MAX_MESSAGE_BYTES} bytes" in PAGES["docs/how-to/drive-headless.md"]


def test_every_state_of_a_session_is_in_the_table_of_steps_or_ends_it() -> None:
    page = PAGES["docs/how-to/drive-headless.md"].split("| page's state | step that leads on |")[1].split("\n\n")[0]
    states = {span for row in rows_of(page) for span in spans_of(row[0])}
    assert states | TERMINAL == set(FLOW.states)
    assert {span for row in rows_of(page) for span in spans_of(row[1])} - {"status", "ready", "input"} <= {
        *STEP_DATA,
        "content.can_resume",
    }


# ---- the study file and the export


def test_every_key_of_the_study_file_is_documented_with_what_it_means() -> None:
    page = reference.study_file()
    top = reference.StudyTable("Top of the file", "", Study)
    tables = [top, *reference.study_tables()]
    assert {item.path for item in tables} >= {"arbiter", "conditions", "texts.debrief_questions", "recruitment"}
    for item in tables:
        heading = f"## `{item.header}`\n" if item.path else f"## {item.header}\n"
        rows = {row[0].strip("`"): row for row in rows_of(page.split(heading)[1].split("\n## ")[0])[1:]}
        assert tuple(rows) == reference.own_keys(item.model), item.header
        for key, (_, value, default, meaning) in rows.items():
            assert value, f"{item.header} {key} has no type"
            assert default, f"{item.header} {key} has no default, and does not say that it must be given"
            assert meaning, f"{item.header} {key} does not say what it means"


def test_every_parameter_of_a_part_is_documented_with_what_it_means() -> None:
    page = reference.study_file()
    items = list(reference.part_tables())
    assert {item.line for item in items} >= {'kind = "readings"', 'kind = "nback"', 'arbiter = "balanced"'}
    for item in items:
        section = page.split(f"## `{item.header}` with `{item.line}`\n")[1].split("\n## ")[0]
        rows = {row[0].strip("`"): row for row in rows_of(section)[1:]}
        assert set(rows) == {field.name for field in dataclasses.fields(item.parameters)}
        for key, row in rows.items():
            assert all(row), f"{item.line} {key}: a blank cell in {row}"


def test_the_reference_of_the_study_file_gives_bounds_and_choices() -> None:
    page = reference.study_file()
    assert "| `planning_delay` | number, at least 0, at most 1 | `0.2` |" in page
    assert '| `transition` | `"mix"` or `"replan"` | `"mix"` |' in page
    assert "| `entropy_floor` | number, more than 0, at most 1 | `0.1` |" in page
    heading = '## `[[conditions]]` with `arbiter = "balanced"`'
    assert '| `alpha` | number or `"calibrated"` | must be given |' in page.split(heading)[1].split("\n## ")[0]
    assert "| `layout` | `arc` |" in page


def test_every_key_and_table_of_the_study_file_that_is_named_exists() -> None:
    models: list[type[BaseModel]] = [
        Study,
        QuestionnaireFile,
        QuestionnaireItem,
        *(item.model for item in reference.study_tables()),
        *(model_of(item.parameters) for item in reference.part_tables()),
    ]
    keys = {key for model in models for key in model.model_fields}
    headers = {item.header for item in reference.study_tables()} | {"[[items]]"}
    named = {span for span in SPANS if re.fullmatch(r"\[+[a-z_.]+\]+", span)}
    assert len(named) > 4
    assert named <= headers, named - headers
    assigned = {found[1] for span in SPANS if (found := re.fullmatch(r"(\w+) = (?:true|false|\d.*|\".*\")", span))}
    assert len(assigned) > 2
    assert assigned <= keys, assigned - keys


def test_every_toml_example_is_taken() -> None:
    found = [text for page in PAGES.values() for text in blocks("toml", page)]
    assert found
    for text in found:
        data = tomllib.loads(text)
        if "items" in data:
            assert file_problems(text.encode(), "example.toml") == ()
            continue
        if "places_m" in data:
            assert model_problems(LayoutFile, data) == ()
            own = [item["id"] for item in data["objects"]]
            using = in_use({"layout": "own", "layouts": [{"id": "own", **data}], "objects": own})
            assert using is not None and list(world_problems(using)) == []
            continue
        for name, values in data.items():
            if name == "distractor":  # what it takes depends on its kind
                assert list(part_problems({"distractor": values}, shelf())) == []
                continue
            part: Any = Study.model_fields[name].annotation
            TypeAdapter(part).validate_python(values)


def test_every_exported_table_is_described() -> None:
    page = PAGES["docs/how-to/read-an-export.md"]
    assert set(re.findall(r"^\| `([a-z_]+)` \|", page, re.MULTILINE)) == set(TABLES)


def test_every_column_is_in_the_reference_as_in_the_codebook() -> None:
    parts = re.split(r"^## ", reference.export_columns(), flags=re.MULTILINE)[1:]
    rows = [(part.split("`")[1], *row) for part in parts for row in rows_of(part)[1:]]
    assert [(table, name, unit, meaning) for table, name, _, unit, meaning in rows] == [
        (info.table, f"`{info.name}`", info.unit or "", words.cell(info.description)) for info in codebook()
    ]


# ---- pictures, files, links


def shown(text: str) -> set[str]:
    return set(re.findall(r"\(\S*?pictures/([\w-]+\.png)\)", text))


def test_every_picture_is_there_and_small_and_shown() -> None:
    assert shown(ALL) == {path.name for path in PICTURES.iterdir()}
    assert len(shown(PAGES["README.md"])) == 3
    for path in PICTURES.iterdir():
        assert path.read_bytes().startswith(b"\x89PNG")
        assert path.stat().st_size <= MAX_PICTURE_BYTES, path.name


def test_every_file_and_folder_named_exists() -> None:
    folders = ("app", "sim", "study", "tests", "static", "docs")
    named = {span.rstrip("/") for span in SPANS if re.fullmatch(r"[\w.-]+(/[\w.-]+)+/?", span)}
    named = {name for name in named if name.split("/")[0] in folders}
    assert len(named) > 40
    assert not [name for name in named if not (ROOT / name).exists()]
    at_the_top = {span for span in SPANS if re.fullmatch(r"[A-Z]{6,}\.\w+|LICENSE|Makefile", span)}
    assert not [name for name in at_the_top if not (ROOT / name).exists()]


def anchors_of(text: str) -> set[str]:
    """The anchors of a page's headings, as they are made for Markdown."""
    headings = re.findall(r"^#+ (.+)$", FENCE.sub("", text), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES)
def test_every_link_leads_somewhere(page: str) -> None:
    for target in re.findall(r"\]\(([^)\s]+)\)", FENCE.sub("", PAGES[page])):
        assert "://" not in target, f"{target}: pages refer to the project alone"
        name, _, anchor = target.partition("#")
        path = (ROOT / page).parent / name
        assert path.is_file(), f"{page} links to {target}"
        if anchor:
            assert anchor in anchors_of(path.read_text(encoding="utf-8")), f"{page} links to {target}"


def test_every_page_is_in_the_table_of_contents() -> None:
    index = PAGES["docs/index.md"]
    listed = [
        line for found in FENCE.finditer(index) for line in found[2].splitlines() if line and not line.startswith(":")
    ]
    pages = {str(path.relative_to(DOCS).with_suffix("")) for path in DOCS.rglob("*.md")} - {"index"}
    assert sorted(listed) == sorted(pages)


def test_every_generated_page_is_somewhere_once() -> None:
    marks = [name for text in PAGES.values() for name in reference.MARK.findall(text)]
    assert sorted(marks) == sorted(reference.GENERATED)
    filled = reference.fill("before\n<!-- generated: settings -->\nafter")
    assert filled == f"before\n{reference.settings()}\nafter"


def test_every_package_tells_what_it_is_in_the_reference() -> None:
    told = reference.packages()
    readmes = sorted(path for room in ("app", "sim", "study", "static") for path in (ROOT / room).rglob("README.md"))
    for readme in [*readmes, *sorted((ROOT / "tests").glob("README.md"))]:
        heading = readme.read_text(encoding="utf-8").splitlines()[0]
        assert f"#{heading}\n" in told, readme


def test_every_place_of_the_packages_page_has_a_readme() -> None:
    for room in reference.ROOMS:
        assert list(ROOT.glob(f"{room}/README.md")), f"nothing stands at {room}"


def rooms_with_a_readme() -> list[str]:
    return sorted(
        str(path.parent.relative_to(ROOT))
        for room in ("app", "study", "sim", "static")
        for path in (ROOT / room).rglob("README.md")
    )


@pytest.mark.parametrize("room", rooms_with_a_readme())
def test_every_readme_names_every_module_beside_it(room: str) -> None:
    named = set(spans_of((ROOT / room / "README.md").read_text(encoding="utf-8")))
    beside = {path.name for path in (ROOT / room).iterdir() if path.suffix in (".py", ".js")}
    missing = sorted(beside - named - {"__init__.py"})
    assert not missing, f"{room}/README.md does not name {', '.join(missing)}"


def test_the_readme_is_short() -> None:
    assert len(PAGES["README.md"].encode()) <= MAX_README_BYTES


# ---- the recipes


def recipe_steps() -> list[str]:
    recipes = PAGES["CONTRIBUTING.md"].split("## Recipes")[1].split("\n## ")[0]
    return re.findall(r"^\d+\. .*(?:\n   .*)*", recipes, re.MULTILINE)


@pytest.mark.parametrize("step", recipe_steps())
def test_every_name_in_a_recipe_stands_in_a_file_of_its_step(step: str) -> None:
    """A recipe that names what is no longer there would send a stranger the wrong way."""
    spans = spans_of(step)
    files = [ROOT / span for span in spans if (ROOT / span).is_file()]
    text = "\n".join(path.read_text(encoding="utf-8") for path in files)
    for span in spans if files else ():
        name = re.fullmatch(r"(?:\w+\.)?([A-Za-z_]\w*)(?:\(.*\))?", span)
        if name and not (ROOT / span).exists():
            assert re.search(rf"\b{name[1]}\b", text), f"{span} is not in {', '.join(path.name for path in files)}"


# ---- the examples


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with what the examples read: the data of two simulated participants in `pilot`."""
    folder = tmp_path_factory.mktemp("examples")
    arguments = ("simulate", "--participants", "2", "--seed", "7", "--out", str(folder / "pilot"))
    subprocess.run([sys.executable, "-m", "app", *arguments], cwd=ROOT, check=True, capture_output=True, timeout=120)
    return folder


def outputs(page: str, place: Path) -> list[str]:
    """What each Python example of a page prints."""
    printed = []
    for example in blocks("python", PAGES[page]):
        done = subprocess.run(
            [sys.executable, "-W", "error", "-c", f"import sys; sys.path.insert(0, {str(ROOT)!r})\n{example}"],
            cwd=place,
            capture_output=True,
            text=True,
            timeout=120,
        )
        assert done.returncode == 0, done.stderr
        printed.append(done.stdout)
    return printed


def test_the_pages_with_examples_are_these() -> None:
    assert {page for page, text in PAGES.items() if blocks("python", text)} == {
        "docs/how-to/drive-headless.md",
        "docs/how-to/read-an-export.md",
    }


def test_the_trial_without_a_server_runs_as_it_stands(tmp_path: Path) -> None:
    (printed,) = outputs("docs/how-to/drive-headless.md", tmp_path)
    lines = printed.splitlines()
    assert [line.split()[:2] for line in lines] == [[str(n), "pickup" if n % 2 else "dropoff"] for n in range(1, 7)]
    assert all(line.endswith("success") for line in lines)


def test_the_examples_that_read_an_export_run_as_they_stand(place: Path) -> None:
    lengths, beliefs, words, again = outputs("docs/how-to/read-an-export.md", place)
    assert again.startswith("S001 trial 2 same ") and again.endswith(" None\n")
    assert "demographics" in words and "sus_modified" in words
    for printed in (lengths, beliefs):
        for name in ("teleoperation", "goal_oriented", "balanced"):
            assert name in printed
        assert printed.count("pickup") == printed.count("dropoff") == 3
    sure = [float(line.split()[-1]) for line in beliefs.splitlines() if "pickup" in line or "dropoff" in line]
    assert all(0.0 < value <= 1.0 for value in sure)


# ---- who to cite


def test_the_citation_is_of_this_version() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    citation: dict[str, Any] = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["cff-version"] == "1.2.0"
    assert citation["message"]
    assert citation["type"] == "software"
    assert citation["version"] == project["version"]
    assert citation["license"] == project["license"]
    assert citation["authors"] == project["authors"]
    assert citation["authors"][0]["name"] in (ROOT / "LICENSE").read_text(encoding="utf-8")
    (paper,) = citation["references"]
    assert paper["title"] == "Balanced Information Gathering and Goal-Oriented Actions in Shared Autonomy"
    assert paper["type"] == "conference-paper"
    assert all(author["family-names"] and author["given-names"] for author in paper["authors"])
