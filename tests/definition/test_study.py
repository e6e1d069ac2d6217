"""The study file: the paper's study as it ships, every mistake told, and plans drawn from one seed."""

from __future__ import annotations

import pickle
import re
from collections import Counter
from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.trial.parts import make_distractor, shelf
from study.definition.named_parts import parameters_of
from study.definition.part_fields import made
from study.definition.study import (
    DEFAULT_STUDY,
    Study,
    StudyFileError,
    TrialPlan,
    load_study,
    next_order,
    orders,
    parse_study,
    plan_session,
)
from study.flow.flow import FLOW
from study.records import StudyError
from tests.support.study_samples import BINS, OBJECTS, lab_text, shipped_study

SOURCE = DEFAULT_STUDY.read_text(encoding="utf-8")


def parse(text: str) -> Study:
    return parse_study(text, name="mine.toml", shelf=shelf())


def reading(study: Study, trial: TrialPlan, number: int) -> str:
    return make_distractor(study.distractor).stimulus(trial.seed, trial.trial, number).text


def problems(text: str) -> tuple[str, ...]:
    with pytest.raises(StudyFileError) as caught:
        parse(text)
    return caught.value.problems


def changed(old: str, new: str) -> str:
    """A study file with one line changed: the one that shipped first, whose numbers stay what they are."""
    text = lab_text()
    assert text.count(old) == 1, f"{old!r} stands {text.count(old)} times in the study"
    return text.replace(old, new)


@pytest.fixture
def study() -> Study:
    return shipped_study()


def test_the_shipped_study_is_the_papers(study: Study) -> None:
    assert [condition.arbiter for condition in study.conditions] == ["teleoperation", "goal_oriented", "balanced"]
    assert [condition.parameters.get("alpha") for condition in study.conditions] == [None, None, "calibrated"]
    assert (len(study.objects), len(study.bins), study.pickups_per_trial, study.tasks_per_trial) == (6, 2, 3, 6)
    assert (study.distractor.first_s, study.distractor.every_s, study.distractor.answer_within_s) == (10, 20, 20)
    assert (study.task_limit_s, study.trial_limit_s) == (300, 1500)
    assert not study.show_assistance
    assert len(study.instructions.questions) == 3
    assert study.surveys == ("sus_modified", "tlx_raw")
    assert FLOW.skips(study) == {"eligibility"}  # it asks nothing of a device


def test_the_shipped_study_fits_the_simulated_world() -> None:
    from app.trial.world import layout_of, world_problems
    from sim.layouts import checked

    study = load_study(None, world=world_problems)
    layout = checked(layout_of(study))
    assert tuple(spec.id for spec in layout.objects) == study.objects
    assert {item.id for item in layout.bins} >= set(study.bins)


def said_in_full(study: Study) -> dict[str, object]:
    """The study's settings with what its arbiters and its distractor take, defaults included."""
    taken = {}
    for condition in study.conditions:
        kind = shelf().load("arbiter", condition.arbiter, None).Parameters
        taken[condition.id] = condition.arbiter, made(kind, parameters_of(condition, study.arbiter, kind))
    distractor = made(shelf().load("distractor", study.distractor.kind, None).Parameters, study.distractor.parameters)
    common = {name: getattr(study.distractor, name) for name in type(study.distractor).model_fields}
    plain = study.model_dump(exclude={"conditions", "distractor"})
    return {**plain, "conditions": taken, "distractor": (common, distractor)}


SETTINGS = [line for line in SOURCE.splitlines() if re.match(r"[a-z_]+ = [^\[{]|surveys = ", line)]
ONES_OWN = "required = false"  # of one question, not of the study


@pytest.mark.parametrize("line", [line for line in SETTINGS if SOURCE.count(line) == 1 and line != ONES_OWN])
def test_a_setting_that_is_left_out_has_the_value_shown_or_must_be_there(line: str, study: Study) -> None:
    name = line.split(" = ")[0]
    younger = re.search(r" \[(.+)\]$", line)  # in brackets: what it means where it is left out
    expected = parse(SOURCE.replace(line, f"{name} = {younger[1]}")) if younger else study
    found: object = ()
    try:
        found = said_in_full(parse(SOURCE.replace(line + "\n", "")))
    except StudyFileError as error:
        found = [problem for problem in error.problems if f"{name}: missing" in problem]
    assert found and (isinstance(found, list) or found == said_in_full(expected))
    assert younger is None or said_in_full(expected) != said_in_full(study), "in brackets stands what is shown"


def test_every_demographic_question_can_be_declined(study: Study) -> None:
    assert {"gaming_experience", "gamepad_experience", "robot_experience"} <= {item.id for item in study.demographics}
    for item in study.demographics:
        assert "no_answer" in [option.id for option in item.options], item.id


def test_the_hash_is_of_the_bytes_and_the_text_is_kept(study: Study) -> None:
    assert study.source_text == SOURCE
    assert study.hash != parse(SOURCE + "\n# a comment\n").hash
    assert study.hash == parse(study.source_text).hash


def test_the_consent_hash_follows_the_consent_alone(study: Study) -> None:
    other_title = parse(changed('title = "Moving', 'title = "Shifting'))
    other_contact = parse(changed('contact = "Questions', 'contact = "Complaints'))
    assert other_title.consent.hash == study.consent.hash
    assert other_contact.consent.hash != study.consent.hash


def test_a_study_goes_to_a_worker_unchanged(study: Study) -> None:
    assert pickle.loads(pickle.dumps(study)) == study


@pytest.mark.parametrize(
    ("old", "new", "field", "says"),
    [
        ("speed_m_s = 0.04", "speed_m_s = 0.4", "robot.speed_m_s = 0.4", "above 0.0 and at most 0.1"),
        ("gripper_ticks = 2 ", "gripper_ticks = 2.5 ", "robot.gripper_ticks = 2.5", "must be a whole number"),
        ("first_s = 10.0", "first_s = nan", "distractor.first_s = nan", "at least 0.0"),
        ("enabled = true", "enabled = 1", "distractor.enabled = 1", "must be true or false"),
        ('transition = "mix"', 'transition = "mx"', 'arbiter.transition = "mx"', "did you mean 'mix'? allowed: mix, "),
        ('layout = "arc"', 'layout = "arch"', 'layout = "arch"', "did you mean 'arc'? layouts: arc, crescent, rows"),
        ('"right_bin"]', '"righ_bin"]', 'bins[2] = "righ_bin"', "did you mean 'right_bin'? bins: left_bin, right_bin"),
        ('"right_bin"]', '"left_bin"]', 'bins[2] = "left_bin"', "repeats entry 1"),
        ('["sus_modified",', '["sus",', 'surveys[1] = "sus"', "surveys: sus_modified, tlx_raw"),
        ("pickups_per_trial = 3", "pickups_per_trial = 7", "pickups_per_trial = 7", "at most 6"),
        ("pickups_per_trial = 3", "pickups_per_trial = 0", "pickups_per_trial = 0", "at least 1"),
        ("practice = true", "practise = true", "practise = true", "did you mean 'practice'?"),
        ('alpha = "calibrated"', 'alpha = "auto"', 'conditions[3].alpha = "auto"', 'at least 0, or "calibrated"'),
        ('alpha = "calibrated"', "", "conditions[3].alpha", "missing"),
        ('arbiter = "goal_oriented"', 'arbiter = "goal_oriented"\nalpha = 3', "conditions[2].alpha = 3", "must be 0"),
        ('id = "balanced"', 'id = "teleoperation"', 'conditions[3].id = "teleoperation"', "repeats entry 1"),
        ('id = "balanced"', 'id = "Balanced!"', 'conditions[3].id = "Balanced!"', "lower-case"),
        ('correct = "log"', 'correct = "type"', 'instructions.questions[2].correct = "type"', "ignore, log, stop"),
        ("answer_within_s = 20.0", "answer_within_s = 25", "distractor.answer_within_s = 25", "every_s, which is 20"),
        ("away_min_s = 5.0", "away_min_s = 21", "distractor.away_min_s = 21", "answer_within_s, which is 20"),
        ("decimals = 1", "decimals = 4", "distractor.decimals = 4", "below digits, which is 4"),
        ("task_limit_s = 300 ", "task_limit_s = -1 ", "task_limit_s = -1", "at least 0.0"),
        ("task_limit_s = 300 ", "task_limit_s = 1600 ", "task_limit_s = 1600", "at most trial_limit_s, which is 1500"),
        ("task_limit_s = 300 ", "task_limit_s = 20 ", "task_limit_s = 20", "answer_within_s, which is 20"),
        ("trial_limit_s = 1500 ", "trial_limit_s = 100 ", "task_limit_s = 300", "at most trial_limit_s, which is 100"),
        ('gamepad = "any" ', 'gamepad = "must" ', 'eligibility.gamepad = "must"', "allowed: any, preferred, required"),
        ("max_round_trip_ms = 0 ", "max_round_trip_ms = -1 ", "eligibility.max_round_trip_ms = -1", "at least 0.0"),
        ("browsers = []", 'browsers = ["ie"]', 'eligibility.browsers[1] = "ie"', "chrome, edge, firefox"),
        ("open = false", "open = true", "recruitment.quota = 0", "at least 1 when open is true"),
        ('person = "PROLIFIC_PID"', 'person = "PID"', 'recruitment.person = "PID"', "STUDY_ID"),
        ('"STUDY_ID", "SESS', '"STUDY ID", "SESS', 'recruitment.id_parameters[2] = "STUDY ID"', "letters"),
        ('full_link = ""', 'full_link = "www.x.org"', 'recruitment.full_link = "www.x.org"', "https://"),
        (
            'screened_out_link = ""',
            'screened_out_link = "https://x.org/?p={PID}"',
            'recruitment.screened_out_link = "https://x.org/?p={PID}"',
            "{PID} is none of the id_parameters: PROLIFIC_PID, STUDY_ID, SESSION_ID",
        ),
        ('title = "', 'hash = "0"\ntitle = "', 'hash = "0"', "unknown field"),
    ],
)
def test_a_mistake_names_its_line_field_value_and_what_is_allowed(old: str, new: str, field: str, says: str) -> None:
    text = changed(old, new)
    found = problems(text)
    assert len(found) == 1, found
    assert f": {field}: " in found[0]
    assert says in found[0]
    if new and " = " in field:  # the value stands in the file, so its line is told
        place, line = found[0].split(": ")[0].split(":")
        assert place == "mine.toml"
        key = field.split(" = ")[0].split(".")[-1].split("[")[0]
        assert text.splitlines()[int(line) - 1].startswith(key)


def test_all_mistakes_are_told_at_once_in_the_order_of_the_file() -> None:
    text = changed("speed_m_s = 0.04", "speed_m_s = -1").replace("first_s = 10.0", 'first_s = "ten"')
    text = text.replace('layout = "arc"', "").replace('bins = ["left_bin", "right_bin"]', "bins = []")
    found = problems(text)
    assert [line.split(": ")[1].split(" = ")[0] for line in found] == [
        "layout",
        "bins",
        "robot.speed_m_s",
        "distractor.first_s",
    ]


def test_wrong_shapes_are_sentences_too() -> None:
    found = problems("title = 3\nconsent = 5\nconditions = []\nobjects = 5\ntexts = []\ninstructions = {text = 3}\n")
    assert any("mine.toml:2: consent = 5: must be a table, not a whole number" in line for line in found)
    assert any("objects = 5: must be a list" in line for line in found)
    assert any("layout: missing" in line for line in found)


def test_broken_toml_names_the_line() -> None:
    assert problems('title = "x"\nlayout = = 3\n')[0].startswith("mine.toml:2: not valid TOML")


def test_a_file_that_cannot_be_read_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(StudyFileError, match=r"^.*nowhere\.toml: cannot be read: No such file"):
        load_study(tmp_path / "nowhere.toml")
    (tmp_path / "latin.toml").write_bytes(b'title = "Stra\xdfe"')
    with pytest.raises(StudyFileError, match="not UTF-8"):
        load_study(tmp_path / "latin.toml")


def test_a_layout_with_fewer_places_than_objects_is_refused() -> None:
    small = '\n[[layouts]]\nid = "small"\nplaces_m = [[0.85, -0.3], [0.85, -0.1], [0.85, 0.1], [0.85, 0.3]]\n'
    with pytest.raises(StudyFileError, match="has 6 entries, layout 'small' has room for 4"):
        parse_study(changed('layout = "arc"', 'layout = "small"') + small)


def test_a_study_without_practice_demographics_and_surveys_skips_them() -> None:
    text = changed('surveys = ["sus_modified", "tlx_raw"]', "surveys = []").replace(
        "practice = true", "practice = false"
    )
    start, end = text.index("[[demographics]]"), text.index("[instructions]")
    assert FLOW.skips(parse(text[:start] + text[end:])) == {"eligibility", "demographics", "practice_ready", "survey"}


# ---- conditions


def with_conditions(count: int) -> Study:
    """The shipped study with so many conditions, which differ in alpha alone."""
    start, end = SOURCE.index("[[conditions]]"), SOURCE.index("[arbiter]")
    tables = [f'[[conditions]]\nid = "alpha_{n}"\narbiter = "balanced"\nalpha = {n}\n' for n in range(count)]
    return parse(SOURCE[:start] + "\n".join(tables) + "\n" + SOURCE[end:])


@pytest.mark.parametrize(("count", "expected"), [(1, 1), (2, 2), (5, 120), (6, 6), (7, 14), (12, 12)])
def test_any_number_of_conditions_is_counterbalanced(count: int, expected: int) -> None:
    study = with_conditions(count)
    found = orders(study)
    assert len(set(found)) == len(found) == expected
    places = Counter((place, condition) for order in found for place, condition in enumerate(order))
    assert len(places) == count**2 and len(set(places.values())) == 1
    followers = Counter(pair for order in found for pair in pairwise(order))
    assert len(followers) == count * (count - 1) and len(set(followers.values())) <= 1
    plan = plan_session(study, next_order(study, {}), 3)
    assert [trial.condition for trial in plan.trials] == list(found[0])


@pytest.mark.parametrize("count", [4, 5, 6, 7])
def test_whoever_stops_early_has_every_condition_in_every_place_as_often(count: int) -> None:
    found = orders(with_conditions(count))
    for stopped in range(count, len(found) + 1, count):
        places = Counter((place, name) for order in found[:stopped] for place, name in enumerate(order))
        assert set(places.values()) == {stopped // count}


# ---- plans


def test_six_orders_and_the_least_filled_comes_next(study: Study) -> None:
    assert len(set(orders(study))) == 6
    first, second, *_ = orders(study)
    assert next_order(study, {}) == first
    assert next_order(study, {first: 1}) == second
    assert next_order(study, dict.fromkeys(orders(study), 2) | {second: 1}) == second
    assert next_order(study, {("something", "else"): 5}) == first


@settings(deadline=None)
@given(st.lists(st.integers(0, 10**6), max_size=60), st.integers(1, 4))
def test_cells_fill_evenly_and_given_back_ones_are_filled_again(leavers: list[int], rounds: int) -> None:
    study = shipped_study()
    taken: Counter[tuple[str, ...]] = Counter()
    for leaver in leavers:  # people enrol, and now and then someone withdraws
        taken[next_order(study, taken)] += 1
        if leaver % 3 == 0:
            held = sorted(order for order, count in taken.items() if count)
            taken[held[leaver % len(held)]] -= 1
    goal = max([*taken.values(), rounds])
    for _ in range(goal * 6 - sum(taken.values())):
        taken[next_order(study, taken)] += 1
    assert {taken[order] for order in orders(study)} == {goal}


@settings(deadline=None)
@given(st.integers(0, 2**63))
def test_a_plan_is_complete_and_the_same_every_time(seed: int) -> None:
    study = shipped_study()
    order = orders(study)[seed % 6]
    plan = plan_session(study, order, seed)
    assert plan == plan_session(study, order, seed)
    assert tuple(trial.condition for trial in plan.trials) == order
    for trial in plan.trials:
        assert sorted(trial.placement) == sorted(OBJECTS)
        assert len({pickup.object for pickup in trial.pickups}) == 3
        assert {pickup.bin for pickup in trial.pickups} <= set(BINS)


def test_streams_are_independent(study: Study) -> None:
    """Fewer pickups, other readings or another order leave the rest of what is drawn as it was."""
    order = orders(study)[0]
    plan = plan_session(study, order, 11)
    short = plan_session(parse(changed("pickups_per_trial = 3", "pickups_per_trial = 1")), order, 11)
    long_readings = plan_session(parse(changed("digits = 4", "digits = 7")), order, 11)
    for whole, one in zip(plan.trials, short.trials, strict=True):
        assert one.pickups == whole.pickups[:1]
        assert one.placement == whole.placement
    assert [trial.pickups for trial in long_readings.trials] == [trial.pickups for trial in plan.trials]
    other_order = plan_session(study, orders(study)[5], 11)
    assert [trial.placement for trial in other_order.trials] == [trial.placement for trial in plan.trials]


def test_a_plan_stays_what_it_was() -> None:
    """Recorded data refer to seeds: the same seed must mean the same trial in every later version."""
    study = shipped_study()
    trial = plan_session(study, orders(study)[0], 7).trials[0]
    assert trial.placement == PLACEMENT_OF_SEED_7
    assert [(pickup.object, pickup.bin) for pickup in trial.pickups] == PICKUPS_OF_SEED_7
    assert [reading(study, trial, k) for k in (1, 2, 3)] == ["629.1", "298.3", "184.3"]


PLACEMENT_OF_SEED_7 = ("paper_towels", "bleach_bottle", "sponge_pack", "absorbent_can", "wipes_tub", "spray_bottle")
PICKUPS_OF_SEED_7 = [("bleach_bottle", "right_bin"), ("spray_bottle", "left_bin"), ("sponge_pack", "left_bin")]


def test_objects_bins_and_slots_are_all_used(study: Study) -> None:
    plans = [plan_session(study, orders(study)[0], seed) for seed in range(60)]
    firsts = Counter(plan.trials[0].pickups[0].object for plan in plans)
    assert set(firsts) == set(OBJECTS)
    assert {plan.trials[0].placement[0] for plan in plans} == set(OBJECTS)
    assert {pickup.bin for plan in plans for pickup in plan.trials[2].pickups} == set(BINS)
    assert len({plan.trials[0].pickups for plan in plans} | {plan.trials[1].pickups for plan in plans}) > 60


@pytest.mark.parametrize(("digits", "decimals", "length"), [(4, 1, 5), (1, 0, 1), (9, 4, 10)])
def test_readings_have_the_digits_asked_for(digits: int, decimals: int, length: int) -> None:
    study = parse(changed("digits = 4\ndecimals = 1", f"digits = {digits}\ndecimals = {decimals}"))
    trial = plan_session(study, orders(study)[0], 3).trials[1]
    readings = [reading(study, trial, k) for k in range(1, 30)]
    assert {len(text) for text in readings} == {length}
    assert all(text[0] != "0" and float(text) > 0 for text in readings)
    assert len(set(readings)) > 5


def test_what_cannot_be_planned_says_so(study: Study) -> None:
    with pytest.raises(StudyError, match="not a permutation"):
        plan_session(study, ("balanced",), 1)
    with pytest.raises(StudyError, match="seed -1 must be at least 0"):
        plan_session(study, orders(study)[0], -1)
    plan = plan_session(study, orders(study)[0], 1)
    with pytest.raises(StudyError, match="trials are 1 to 3"):
        plan.trial(4)
    with pytest.raises(StudyError, match="stimulus 0 must be at least 1"):
        reading(study, plan.trial(1), 0)
    with pytest.raises(StudyError, match="it has"):
        study.condition("autonomy")


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ('kind = "text"\nwhole = true', "must be left out with kind 'text'; only a number has it"),
        ('kind = "text"\nleast = 1', "must be left out with kind 'text'"),
        ('kind = "number"\nleast = 2\nmost = 1', "must be at most most, which is 1"),
        ('kind = "number"\nmost = inf', "most = inf: must be"),
        ('kind = "number"\nleast = "18"', 'least = "18": must be'),
    ],
)
def test_bounds_of_a_number_question_that_cannot_be_are_told(keys: str, said: str) -> None:
    before = '[[demographics]]\nid = "gender"'
    found = problems(changed(before, f'[[demographics]]\nid = "x"\nprompt = "?"\n{keys}\n\n{before}'))
    assert any(said in problem for problem in found), found
