"""The files that `salab new --arbiter NAME` writes: an arbiter to change, its test, and a study that has it."""

from __future__ import annotations

import ast
import keyword
import re
import sys
from importlib.machinery import PathFinder
from pathlib import Path
from string import Template

from app.errors import LabError
from app.trial.parts import ARBITERS

_ARBITER = '''\
"""$words: an arbiter of your own, to change.

As it stands it predicts, then acts: with the hands off it goes to the likeliest goal, once that is likely enough.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Ge, Le

from app.autonomy.actions import DIRECTIONS, UNIT_DIRECTIONS, Direction
from app.autonomy.belief import Belief
from app.autonomy.interface import Arbiter, Explanation, Feasible, State

STAY: Direction = (0, 0, 0)


@dataclass(frozen=True)
class Parameters:
    """What a condition of the study file may set. Types, bounds and defaults are checked with the file."""

    confidence: Annotated[float, Ge(0.0), Le(1.0)] = 0.6
    """The likeliest goal must be at least so likely before the arm moves by itself."""


class $class_name(Arbiter):
    """Stays until it is confident, then goes straight to the likeliest goal."""

    Parameters = Parameters
    moves_by_itself = True  # False: the arm moves only while the person does, and `decide` must return STAY else

    # One instance lives for one pick-and-place cycle. Whatever is to outlive it goes into `memory`, a value of JSON of
    # at most 64 kB; a worker that takes over gets it back, and must then decide the same. To remember something:
    #
    #   memory = 0                                        before the first cycle
    #   self.memory = self.memory + 1                     in `decide`
    #
    # Use no randomness and no clock, and keep nothing in the class or the module: the tests find it out.

    def decide(self, state: State, belief: Belief, user: Direction | None, feasible: Feasible) -> Direction:
        """The action of this half second: three of -1, 0 and 1, along x (forward), y (left) and z (up).

        `state` says where the gripper and the goals are (metres, read-only), `belief` how likely each goal is, `user`
        what the person does (None: hands off). It has 100 ms. `self.models` are the study's models of person and arm.
        """
        if user is not None:
            return user  # the person always wins; return something else to blend
        likeliest = int(np.argmax(belief.probabilities))
        if belief.probabilities[likeliest] < self.parameters.confidence:
            return STAY
        way_m = state.goals_m[likeliest] - np.array(state.position_m)
        if np.linalg.norm(way_m) < self.models.transition.step_m:
            return STAY  # there; closing the gripper is the person's
        progress_m = UNIT_DIRECTIONS @ way_m
        for index in np.argsort(-progress_m, kind="stable"):
            # Only what the arm can do without pushing anything over, and go on from (keep_way_on), may be chosen.
            if progress_m[index] > 0.0 and feasible(DIRECTIONS[index]):
                return DIRECTIONS[index]
        return STAY

    def explain(self, state: State, belief: Belief, user: Direction | None, action: Direction) -> Explanation:
        """What the experimenter sees of the decision: short names with numbers or texts. It must change nothing."""
        likeliest = int(np.argmax(belief.probabilities))
        return {
            "likeliest": belief.goal_ids[likeliest],
            "probability": float(belief.probabilities[likeliest]),
            "confidence": self.parameters.confidence,
        }
'''

_TEST = '''\
"""Run with: pytest test_$name.py"""

from __future__ import annotations

import numpy as np
from $name import $class_name, Parameters

from app.autonomy.belief import Belief
from app.autonomy.interface import Models, State
from app.contracts.arbiter import ArbiterContract


class Test$class_name(ArbiterContract):
    """What every arbiter must keep: the same answers always, feasible, quick, restored from its memory."""

    arbiter = "$name.py:$class_name"


def test_it_moves_once_it_is_confident() -> None:
    goals_m = np.array([[0.9, 0.0, 0.9], [0.7, 0.4, 0.9]])
    state = State((0.7, 0.0, 0.9), (0.0, 0.0, 0.0), ("front", "left"), goals_m)
    arbiter = $class_name(Parameters(confidence=0.6), Models())
    unsure, sure = (Belief(("front", "left"), np.array([p, 1.0 - p])) for p in (0.5, 0.8))
    assert arbiter.decide(state, unsure, None, lambda action: True) == (0, 0, 0)
    assert arbiter.decide(state, sure, None, lambda action: True) == (1, 0, 0)
    assert arbiter.decide(state, sure, (0, 0, 1), lambda action: True) == (0, 0, 1)
'''

_CONDITION = """\
[[conditions]]
id = "$name"
arbiter = "$name.py:$class_name"   # in the file beside this one: it runs only where --trust is said
confidence = 0.6

"""
_BEHIND_THE_CONDITIONS = "[arbiter]\n"
_WHAT_DIFFERS = {
    "about what you want. We study": "about what you want. In one round it went straight to what you most likely "
    "wanted, once it was sure enough. We study",
}
"""What participants read of the conditions."""


def arbiter_files(name: str) -> dict[str, str]:
    """The arbiter and its test, by file name. Raises `LabError` for a name that cannot be one."""
    _check(name)
    return {f"{name}.py": _filled(_ARBITER, name), f"test_{name}.py": _filled(_TEST, name)}


def with_condition(study: str, name: str) -> str:
    """The text of a study of three conditions, with the new arbiter as its fourth."""
    before, found, after = study.partition(f"\n{_BEHIND_THE_CONDITIONS}")
    assert found, "the shipped study has a table [arbiter] behind its conditions"
    for old, new in _WHAT_DIFFERS.items():
        assert old in after, f"the shipped study says {old!r}"
        after = after.replace(old, new)
    return f"{before}\n{_filled(_CONDITION, name)}{_BEHIND_THE_CONDITIONS}{after}"


def _filled(template: str, name: str) -> str:
    words = name.replace("_", " ").strip()
    return Template(template).substitute(name=name, class_name=_class_name(name), words=words[0].upper() + words[1:])


def _class_name(name: str) -> str:
    return "".join(part[:1].upper() + part[1:] for part in name.split("_"))


def _names_in(code: str) -> set[str]:
    """Every name that this code defines, imports or uses."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(code)):
        if isinstance(node, ast.Name):
            found.add(node.id)
        elif isinstance(node, ast.arg):
            found.add(node.arg)
        elif isinstance(node, (ast.ClassDef, ast.FunctionDef)):
            found.add(node.name)
        elif isinstance(node, ast.alias):
            found.add(node.asname or node.name)
    return found


def _check(name: str) -> None:
    if not re.fullmatch(r"[a-z][a-z0-9_]{0,40}", name) or keyword.iskeyword(name) or name.startswith("test_"):
        raise LabError(f"{name!r} is no name for an arbiter; give lower-case letters, digits and _, such as blend")
    if name in ARBITERS.names:
        raise LabError(f"{name!r} is an arbiter already; arbiters are {', '.join(ARBITERS.names)}. Choose another name")
    another = f"{name}_or_another"  # so that whatever is called as it should be is of the files' own
    taken = _names_in(_filled(_ARBITER, another)) | _names_in(_filled(_TEST, another))
    if {name, _class_name(name)} & taken or keyword.iskeyword(_class_name(name)):
        raise LabError(f"{name!r} is a name that the files written need themselves; choose another name")
    elsewhere = [place for place in sys.path if place and Path(place).resolve() != Path.cwd()]
    if name in sys.stdlib_module_names or PathFinder.find_spec(name, elsewhere) is not None:
        raise LabError(f"{name!r} is the name of an installed module, which {name}.py would hide; choose another name")
