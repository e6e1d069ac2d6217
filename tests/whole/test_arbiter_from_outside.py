"""An arbiter that somebody else wrote, from an installed package or a file beside the study file: live, simulated,
analysed, exported, restarted with. No file of the lab is touched."""

from __future__ import annotations

import asyncio
import hashlib
import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from app.__main__ import main
from app.simulated.bot import run_bot
from app.simulated.connection import BotError
from app.trial.world import parse_stored
from study.export.export import read_table
from tests.support.dashboard_client import dashboard
from tests.support.lab_server import ROOT, LabDidNotStart, LabServer
from tests.support.outside_package import install_project, installed_at, salab
from tests.support.wire_client import Player, asked, invite, seen_by_experimenter, stored, visit

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

EXAMPLE = ROOT / "docs" / "examples" / "01_arbiter_package"
LIVE = ("--robot", "kinematic", "--pace", "lockstep", "--no-scene")
STAY = "(0, 0, 0)"

BLEND = '''
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

from annotated_types import Ge, Le

from app.autonomy.interface import Arbiter


@dataclass(frozen=True)
class Parameters:
    share: Annotated[float, Ge(0.0), Le(1.0)] = 0.5
    """How much of it."""


class Blend(Arbiter):
    Parameters: ClassVar[type[Any]] = Parameters

    def decide(self, state, belief, user, feasible):
        return user or (0, 0, 0)

    def explain(self, state, belief, user, action):
        return {"edition": 1, "share": self.parameters.share}
'''
SECOND_EDITION = BLEND.replace('"edition": 1', '"edition": 2')


def four_conditions(first: str = "teleoperation") -> str:
    """The example's study, with the condition that the first participant meets first in the first place."""
    text = (EXAMPLE / "study.toml").read_text(encoding="utf-8")
    before, *conditions = text.split("[[conditions]]\n")
    *others, last = conditions
    last, _, after = last.partition("\n[consent]")
    conditions = [*others, last + "\n"]
    conditions.sort(key=lambda condition: f'id = "{first}"' not in condition)
    return "".join([before, *("[[conditions]]\n" + condition for condition in conditions), "[consent]", after])


def with_blend(extra: str = "") -> str:
    """A study whose two conditions are a file's arbiter and no help; the first participant meets the former first."""
    before, _, rest = four_conditions().partition("[[conditions]]\n")
    after = rest.partition("[consent]")[2]
    blend = f'[[conditions]]\nid = "blended"\narbiter = "blend.py:Blend"\n{extra}\n'
    plain = '[[conditions]]\nid = "teleoperation"\narbiter = "teleoperation"\n\n'
    return f"{before}{blend}{plain}[consent]{after}"


def write(folder: Path, study: str, blend: str | None = BLEND) -> Path:
    file = folder / "study.toml"
    file.write_text(study, encoding="utf-8")
    if blend is not None:
        (folder / "blend.py").write_text(blend, encoding="utf-8")
    return file


@pytest.fixture
def site(tmp_path: Path) -> Path:
    """The installed packages of a machine that has the example's."""
    folder = tmp_path / "site"
    folder.mkdir()
    install_project(folder, EXAMPLE)
    return folder


# --- as a fourth condition -----------------------------------------------------------------------------------------


@pytest.mark.slow
async def test_a_packages_arbiter_is_a_fourth_condition_live_and_on_the_dashboard_and_in_the_export(
    start_lab: Callable[..., LabServer], site: Path, tmp_path: Path
) -> None:
    study = write(tmp_path, four_conditions("when_sure"), None)
    lab = start_lab(*LIVE, "--study", str(study), environment=installed_at(site))
    made = invite(lab)
    async with dashboard(lab) as board:
        await board.watch(made["participant"])
        driving = asyncio.create_task(run_bot(made["link"]))  # the whole session, its trials to their end
        news = await board.news(lambda message: any(tick["explanation"] for tick in message["ticks"]))
        told = next(tick["explanation"] for tick in news["ticks"] if tick["explanation"])
        await driving
    assert set(told) == {"likeliest", "probability", "needed", "distance_m"}
    assert told["likeliest"] in ("spray_bottle", "bleach_bottle", "paper_towels", "wipes_tub")
    assert (told["needed"], told["probability"]) == (0.4, pytest.approx(0.25, abs=0.1))
    out = tmp_path / "out"
    assert main(["export", "--data", str(lab.data_dir), "--out", str(out)]) == 0
    trial = next(row for row in read_table(out, "trials") if row.condition == "when_sure")
    assert (trial.trial, trial.outcome) == (1, "completed")
    assert json.loads(trial.parameters)["condition"] == "predict_then_act"
    assert json.loads(trial.parameters)["confidence"] == 0.4
    source = (EXAMPLE / "predict_then_act.py").read_text(encoding="utf-8")
    text = (out / "study.toml").read_text(encoding="utf-8")
    (code,) = tomllib.loads(text)["code"]
    assert (code["kind"], code["name"]) == ("arbiter", "predict_then_act")
    assert (code["package"], code["version"]) == ("salab-predict-then-act", "1.0")
    assert code["files"] == [{"name": "predict_then_act.py", "text": source}]
    assert code["sha256"] == hashlib.sha256(json.dumps([["predict_then_act.py", source]]).encode()).hexdigest()
    assert hashlib.sha256(text.encode()).hexdigest() == parse_stored(text, "the export").hash


def test_it_is_simulated_analysed_and_named_in_report_and_figures(site: Path, tmp_path: Path) -> None:
    study, out, report = write(tmp_path, four_conditions(), None), tmp_path / "pilot", tmp_path / "report"
    arguments = ("simulate", "--study", str(study), "--participants", "4", "--workers", "2", "--out", str(out))
    done = salab(*arguments, environment=installed_at(site))
    assert done.returncode == 0, done.stderr
    assert {row.condition for row in read_table(out, "trials")} >= {"when_sure", "balanced"}
    acted = [row for row in read_table(out, "ticks") if row.condition == "when_sure" and row.source == "robot"]
    assert any(f"({row.action_x}, {row.action_y}, {row.action_z})" != STAY for row in acted), "it moves by itself"
    done = salab("analyze", str(out), "--out", str(report), environment=installed_at(site))
    assert done.returncode == 0, done.stderr
    assert "when_sure" in (report / "report.html").read_text(encoding="utf-8")
    assert "when_sure" in (report / "measures.json").read_text(encoding="utf-8")
    assert list(report.rglob("*.svg")) or list(report.rglob("*.png"))


# --- what participants were enrolled with --------------------------------------------------------------------------


async def edition_of(lab: LabServer, participant: str, player: Player) -> object:
    """Which source the session's arbiter is from, as its explanation on the dashboard says."""
    async with dashboard(lab) as board:
        await board.watch(participant)
        await player.tick((1, 0, 0))
        news = await board.news(lambda message: any(tick["explanation"] for tick in message["ticks"]))
        return news["ticks"][-1]["explanation"]["edition"]


def study_hash(lab: LabServer, participant: str) -> str:
    with stored(lab) as store:
        found: str = store.session(participant).study_hash
        return found


def again(lab: LabServer, link: str) -> str:
    """A link, where the lab is now: it was started again, on another port."""
    return f"{lab.base_url}/p/{link.rpartition('/')[2]}"


async def resumed(player: Player) -> None:
    """Go on with the trial that a restart of the lab interrupted."""
    page = await player.page("paused")
    while not page.content["can_resume"]:
        page = await player.page("paused")
    await player.done("resume")
    await player.status("running")


def still_serves(lab: LabServer, refused: str) -> None:
    """All but that participant's session: newcomers, scores, the roster, and ending it."""
    assert asked(lab, "GET", "health").status_code == 200
    newcomer = invite(lab)["participant"]
    assert seen_by_experimenter(lab, newcomer)["state"] == "consent"
    scores = asked(lab, "GET", "summary").json()
    assert scores["trials"]["running"] == 1
    assert refused in {line["participant"] for line in asked(lab, "GET", "roster").json()["lines"]}
    answer = asked(lab, "POST", f"participants/{refused}/withdraw", {"reason": "wants to stop", "keep": True})
    assert (answer.status_code, answer.json()) == (200, {"participant": refused, "state": "withdrawn"})
    assert asked(lab, "GET", "summary").json()["trials"] == {**scores["trials"], "running": 0, "aborted": 1}


def turned_away_because(ended: LabServer) -> str:
    """The one line of its log about a page that was refused."""
    (line,) = [line for line in ended.log().splitlines() if "turned away" in line]
    return line.partition('reason="')[2].removesuffix('"')


async def turned_away(link: str) -> bool:
    """Whether a page with that link is refused at the door."""
    try:
        async with visit(link):
            return False
    except BotError as error:
        return "403" in str(error)


@pytest.mark.slow
async def test_who_began_with_a_files_source_goes_on_with_it_and_newcomers_get_the_new_one(
    start_lab: Callable[..., LabServer], tmp_path: Path
) -> None:
    study, data = write(tmp_path, with_blend()), tmp_path / "data"
    served = (*LIVE, "--study", str(study), "--trust")
    with start_lab(*served, data_dir=data) as lab:
        first = invite(lab)
        async with visit(first["link"]) as player:
            await player.reach_trial()
            assert await edition_of(lab, first["participant"], player) == 1
    write(tmp_path, with_blend(), SECOND_EDITION)
    with start_lab(*served, data_dir=data) as lab:
        second = invite(lab)
        async with visit(again(lab, first["link"])) as player:
            await resumed(player)
            assert await edition_of(lab, first["participant"], player) == 1, "the source they were enrolled with"
        assert study_hash(lab, first["participant"]) != study_hash(lab, second["participant"])
        with stored(lab) as store:
            texts = [store.study_text(study_hash(lab, one["participant"])) for one in (first, second)]
        sources = [tomllib.loads(text)["code"][0]["files"][0]["text"] for text in texts]
        assert sources == [BLEND, SECOND_EDITION]
    with pytest.raises(LabDidNotStart) as caught:
        start_lab(*LIVE, "--study", str(study), data_dir=data)
    reason = "arbiter 'blend.py:Blend' is code from a file beside the study file; it runs only with --trust"
    assert str(caught.value).splitlines()[1:] == [f"salab: {reason}"]
    with start_lab(*LIVE, data_dir=data) as lab:  # the study that ships: new people need nothing of that code
        assert await turned_away(again(lab, first["link"]))
        still_serves(lab, first["participant"])
    assert turned_away_because(lab) == f"{first['participant']} cannot go on: {reason}"


@pytest.mark.slow
async def test_a_package_whose_source_changed_refuses_who_began_with_the_one_before(
    start_lab: Callable[..., LabServer], site: Path, tmp_path: Path
) -> None:
    study, data = write(tmp_path, four_conditions("when_sure"), None), tmp_path / "data"
    served = (*LIVE, "--study", str(study))
    with start_lab(*served, data_dir=data, environment=installed_at(site)) as lab:
        first = invite(lab)
        async with visit(first["link"]) as player:
            await player.reach_trial()
            await player.tick((1, 0, 0))
        before = study_hash(lab, first["participant"])
    module = site / "predict_then_act.py"
    module.write_text(module.read_text(encoding="utf-8") + "\nNEW = True\n", encoding="utf-8")
    info = site / "salab_predict_then_act-1.0.dist-info" / "METADATA"
    info.write_text(info.read_text(encoding="utf-8").replace("Version: 1.0", "Version: 1.1"), encoding="utf-8")
    with start_lab(*served, data_dir=data, environment=installed_at(site)) as lab:
        assert await turned_away(again(lab, first["link"]))
        answer = asked(lab, "POST", f"sessions/{first['participant']}/resume", {"reason": None})
        reason = answer.json()["detail"]
        assert answer.status_code == 503
        assert reason.startswith(
            f"{first['participant']} cannot go on: arbiter 'predict_then_act' was salab-predict-then-act 1.0, source "
        )
        assert "when the study was made; here it is salab-predict-then-act 1.1, " in reason
        assert reason.endswith(". Install that version to go on") and "\n" not in reason
        newcomer = invite(lab)["participant"]
        assert study_hash(lab, newcomer) != before
        still_serves(lab, first["participant"])
    assert turned_away_because(lab) == reason


# --- code of a stranger --------------------------------------------------------------------------------------------

LEAVES_A_MARK = "from pathlib import Path\nPath(__file__).with_name('ran').touch()\nPath('ran').touch()\n" + BLEND


@pytest.fixture
def somewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def told(capsys: pytest.CaptureFixture[str]) -> list[str]:
    """The lines of `salab check`, but for what it says of a look that the study leaves open."""
    return [line for line in capsys.readouterr().out.splitlines() if not line.startswith("It leaves open")]


def test_check_names_the_code_and_runs_none_of_it(somewhere: Path, capsys: pytest.CaptureFixture[str]) -> None:
    study = write(somewhere, with_blend(), LEAVES_A_MARK)
    assert main(["check", str(study)]) == 0
    said = told(capsys)
    digest = hashlib.sha256(json.dumps([["blend.py", LEAVES_A_MARK]]).encode()).hexdigest()
    size = len(LEAVES_A_MARK.encode())
    assert said[1:] == [
        f"would run arbiter blend.py:Blend from {size} bytes beside the study file, SHA-256 {digest}",
        f"Not run, and so not checked: that code. Read it, then: salab check {study} --trust",
        f"layout 'arc' is drawn in {somewhere / 'study.layout.png'}",
    ]
    assert not (somewhere / "ran").exists()
    assert main(["simulate", "--study", str(study), "--participants", "1", "--out", str(somewhere / "out")]) == 1
    refused = "salab: arbiter 'blend.py:Blend' is code from a file beside the study file; it runs only with --trust\n"
    assert capsys.readouterr().err == refused
    assert not (somewhere / "ran").exists() and not (somewhere / "out").exists()
    assert main(["check", str(study), "--trust"]) == 0
    assert (somewhere / "ran").exists(), "it would have been seen"


def test_code_inside_a_study_file_is_a_strangers_too(somewhere: Path, capsys: pytest.CaptureFixture[str]) -> None:
    digest = hashlib.sha256(json.dumps([["blend.py", LEAVES_A_MARK]]).encode()).hexdigest()
    table = f'\n[[code]]\nkind = "arbiter"\nname = "blend.py:Blend"\nsha256 = "{digest}"\n'
    study = write(
        somewhere, f"{with_blend()}{table}files = [{{ name = 'blend.py', text = {json.dumps(LEAVES_A_MARK)} }}]\n", None
    )
    assert main(["check", str(study)]) == 0
    assert "would run arbiter blend.py:Blend" in capsys.readouterr().out
    assert main(["simulate", "--study", str(study), "--participants", "1", "--out", str(somewhere / "out")]) == 1
    assert capsys.readouterr().err.endswith("it runs only with --trust\n")
    study.write_text(study.read_text(encoding="utf-8").replace("edition", "version"), encoding="utf-8")
    for trust in ((), ("--trust",)):
        assert main(["check", str(study), *trust]) == 1
        line = next(line for line in capsys.readouterr().err.splitlines() if "sha256" in line)
        assert f'code[1].sha256 = "{digest[:50]}' in line and line.endswith(": is not the hash of these files")
    assert not (somewhere / "ran").exists()


def held(*sources: str, kind: str = "arbiter", name: str = "blend.py:Blend", files: tuple[str, ...] = ()) -> str:
    """The tables of these sources, as a study's text has them."""
    tables = ""
    for source in sources:
        named = files or (name.partition(":")[0],)
        digest = hashlib.sha256(json.dumps(sorted([file, source] for file in named)).encode()).hexdigest()
        tables += f'\n[[code]]\nkind = "{kind}"\nname = "{name}"\nsha256 = "{digest}"\n'
        for file in named:
            tables += f'[[code.files]]\nname = "{file}"\ntext = {json.dumps(source)}\n'
    return tables


def test_check_says_when_another_source_runs_than_the_file_beside_it(
    somewhere: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    study = write(somewhere, with_blend() + held(LEAVES_A_MARK), BLEND)
    inside = (
        f"arbiter blend.py:Blend from {len(LEAVES_A_MARK.encode())} bytes inside the study file, in its table [[code]]"
    )
    for trust, runs in ((), "would run"), (("--trust",), "runs"):
        assert main(["check", str(study), *trust]) == 0
        said = told(capsys)[1]
        assert said.startswith(f"{runs} {inside}, not from blend.py beside it, which differs, SHA-256 ")
    (somewhere / "blend.py").write_text(LEAVES_A_MARK, encoding="utf-8")
    assert main(["check", str(study)]) == 0
    assert told(capsys)[1].startswith(f"would run {inside}, SHA-256 ")


@pytest.mark.parametrize(
    ("tables", "place", "told"),
    [
        (held(BLEND, SECOND_EDITION), 'code[2].name = "blend.py:Blend"', "repeats entry 1; a part has one source"),
        (
            held(BLEND) + held(BLEND, name="other.py:Blend"),
            'code[2].name = "other.py:Blend"',
            "is the source of no arbiter that this study names; leave it out",
        ),
        (
            held(BLEND, kind="robot"),
            'code[1].kind = "robot"',
            "not known; kinds: arbiter, inference, distractor",
        ),
        (held(BLEND, files=("blend.py", "more.py")), "code[1].files", "must be one file, called blend.py"),
        (held(BLEND, files=("more.py",)), "code[1].files", "must be one file, called blend.py"),
        (
            f'\n[[code]]\nkind = "arbiter"\nname = "blend.py:Blend"\nsha256 = "{hashlib.sha256(b"[]").hexdigest()}"\n',
            "code[1]",
            "must be one file, called blend.py",
        ),
    ],
    ids=["twice", "unused", "kind", "two files", "another file", "no file"],
)
@pytest.mark.parametrize("trust", [(), ("--trust",)])
def test_a_source_that_is_not_what_it_seems_is_a_problem(
    tables: str, place: str, told: str, trust: tuple[str, ...], somewhere: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    study = write(somewhere, with_blend() + tables)
    assert main(["check", str(study), *trust]) == 1
    problems = capsys.readouterr().err.splitlines()[:-1]
    begins = with_blend().count("\n") + 1
    (mine,) = [line for line in problems if place in line]
    assert mine.endswith(told), mine
    assert int(mine.removeprefix(f"{study}:").partition(":")[0]) > begins


def test_packages_in_a_strangers_folder_are_not_installed(site: Path, tmp_path: Path) -> None:
    folder = tmp_path / "stranger"
    folder.mkdir()
    for item in site.iterdir():
        item.rename(folder / item.name)
    (folder / "predict_then_act.py").write_text(LEAVES_A_MARK, encoding="utf-8")
    study = write(folder, four_conditions("when_sure"), None)
    command = [sys.executable, "-m", "app", "check", study.name]
    told = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(command, cwd=folder, env=told, capture_output=True, text=True, timeout=300)
    assert done.returncode == 1
    assert '"predict_then_act": not known; ' in done.stderr and done.stderr.endswith("1 problem\n")
    assert not (folder / "ran").exists()


RAISING = """
from app.autonomy.interface import Arbiter


class Odd(type(Arbiter)):
    def __getattribute__(cls, name):
        if name == "{name}":
            raise {error}
        return super().__getattribute__(name)


class Blend(Arbiter, metaclass=Odd):
    def decide(self, state, belief, user, feasible):
        return (0, 0, 0)
"""
EXITS = BLEND + "\n    def __init__(self, parameters, models):\n        raise SystemExit('by\\ne')\n"
TAKEN = BLEND.replace("share: Annotated", "condition: Annotated")
WITHOUT_METHODS = "from app.autonomy.interface import Arbiter\nclass Blend(Arbiter): pass\n"
NO_SUBCLASS = "class Blend:\n    def decide(self): pass\n"
UNUSABLE = 'conditions[1].arbiter = "blend.py:Blend": its parameters cannot be used: '
NAMED = "conditions[1].arbiter = \"blend.py:Blend\": arbiter 'blend.py:Blend' "


@pytest.mark.parametrize(
    ("blend", "told"),
    [
        (WITHOUT_METHODS, f"{NAMED}lacks decide; it must have decide"),
        (NO_SUBCLASS, f"{NAMED}must be a class derived from app.autonomy.interface.Arbiter"),
        ("class Blend(", f"{NAMED}cannot be loaded: SyntaxError: '(' was never closed"),
        ("import not_there", f"{NAMED}cannot be loaded: ModuleNotFoundError: No module named 'not_there'"),
        ("import sys; sys.exit(3)", f"{NAMED}cannot be loaded: SystemExit: 3"),
        ("Other = 1", f"{NAMED}cannot be loaded: blend.py has no Blend"),
        (
            RAISING.format(name="__abstractmethods__", error="SystemExit(3)"),
            f"{NAMED}cannot be looked at: SystemExit: 3",
        ),
        (RAISING.format(name="Parameters", error="OSError('no\\nway')"), f"{UNUSABLE}OSError: no way"),
        (EXITS, 'conditions[1].arbiter = "blend.py:Blend": arbiter Blend cannot be made: SystemExit: by e'),
        (TAKEN, f"{UNUSABLE}field 'condition' of "),
        (None, f"{NAMED[:-1]}: blend.py cannot be read: No such file or directory"),
    ],
)
def test_a_file_that_is_broken_is_one_line(
    blend: str | None, told: str, somewhere: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    study = write(somewhere, with_blend(), blend)
    assert main(["check", str(study), "--trust"]) == 1
    problem, count = capsys.readouterr().err.splitlines()
    place, _, rest = problem.partition(": ")
    line = study.read_text(encoding="utf-8").splitlines().index('arbiter = "blend.py:Blend"') + 1
    assert place == f"{study}:{line}"
    assert rest.startswith(told), rest
    assert count == f"{study}: 1 problem"


@pytest.mark.parametrize("workers", ["1", "2"])
def test_one_that_fails_among_simulated_people_is_one_line(workers: str, tmp_path: Path) -> None:
    study = write(tmp_path, with_blend(), BLEND.replace("return user or (0, 0, 0)", "return 1 / 0"))
    people = ("--participants", "2", "--workers", workers, "--out", str(tmp_path / "out"))
    done = salab("simulate", "--study", str(study), "--trust", *people)
    assert done.returncode == 1
    told = "salab: arbiter 'blend.py:Blend' raised ZeroDivisionError: division by zero"
    assert done.stderr.splitlines()[-1] == told
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("name", "told"),
    [
        (
            "blnd",
            'conditions[1].arbiter = "blnd": not known; '
            "did you mean 'balanced'? arbiters: teleoperation, goal_oriented, balanced, "
            "or your own as file.py:Class in a file beside this one",
        ),
        (
            "../evil.py:X",
            'conditions[1].arbiter = "../evil.py:X": must be a name, or file.py:Class for one in a file beside this '
            "one",
        ),
        ("blend.py", "; a file beside the study file is named as blend.py:Blend"),
    ],
)
def test_a_name_that_leads_nowhere_is_told_with_what_there_is(
    name: str, told: str, somewhere: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (somewhere.parent / "evil.py").write_text(LEAVES_A_MARK, encoding="utf-8")
    study = write(somewhere, with_blend().replace("blend.py:Blend", name))
    assert main(["check", str(study), "--trust"]) == 1
    problem, count = capsys.readouterr().err.splitlines()
    assert told in problem, problem
    assert count == f"{study}: 1 problem"
    assert not (somewhere / "ran").exists() and not (somewhere.parent / "ran").exists()


@pytest.mark.parametrize(
    ("extra", "told"),
    [
        ("share = 1.5", "conditions[1].share = 1.5: must be a number at least 0.0 and at most 1.0"),
        ('share = "half"', 'conditions[1].share = "half": must be a number at least 0.0 and at most 1.0, not a text'),
        ("shares = 0.5", "conditions[1].shares = 0.5: unknown field; did you mean 'share'?"),
    ],
)
def test_a_parameter_that_cannot_be_is_told_with_file_line_and_bound(
    extra: str, told: str, somewhere: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    study = write(somewhere, with_blend(extra))
    assert main(["check", str(study), "--trust"]) == 1
    problem, count = capsys.readouterr().err.splitlines()
    line = study.read_text(encoding="utf-8").splitlines().index(extra) + 1
    assert problem.startswith(f"{study}:{line}: {told}"), problem
    assert count == f"{study}: 1 problem"
    assert main(["check", str(study)]) == 0, "nothing of it runs without --trust, so nothing is known of it"


def test_one_wrong_name_is_one_problem(somewhere: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before, only, rest = with_blend().replace("blend.py:Blend", "../evil.py:X").split("[[conditions]]\n")
    study = write(somewhere, f"{before}[[conditions]]\n{only}[consent]{rest.partition('[consent]')[2]}")
    assert main(["check", str(study)]) == 1
    problem, count = capsys.readouterr().err.splitlines()
    assert 'conditions[1].arbiter = "../evil.py:X": must be a name' in problem
    assert count == f"{study}: 1 problem"


def test_a_name_that_is_taken_is_an_error_wherever_it_is_looked_up(site: Path, tmp_path: Path) -> None:
    points = site / "salab_predict_then_act-1.0.dist-info" / "entry_points.txt"
    points.write_text("[salab.arbiters]\nbalanced = predict_then_act:PredictThenAct\n", encoding="utf-8")
    study = write(tmp_path, four_conditions(), None)
    done = salab("check", str(study), environment=installed_at(site))
    assert done.returncode == 1
    told = (
        "salab-predict-then-act registers arbiter 'balanced', which is app.autonomy.arbiters.balanced:Balanced "
        "already; rename it there, or uninstall one of the two"
    )
    assert told in done.stderr
    assert "Traceback" not in done.stderr
