"""What `make test` leaves to `make test-long`: of kinds with many slow cases, all but some.

Each row is a test and the cases of it that stay in the everyday suite, by the beginning of what stands in its brackets.
A test that has no other of its kind is never left out.
"""

from __future__ import annotations

from collections.abc import Mapping

KEPT: Mapping[str, tuple[str, ...]] = {
    "tests/session/test_faults.py::test_the_trial_pauses_with_the_reason_and_goes_on": (
        "Raises",
        "HangsInC",
        "EndsItsProcess",
    ),
    "tests/session/test_faults.py::test_the_api_asks_it_where_it_harms_nobody": ("EndsItsProcess",),
    "tests/session/test_saving.py::test_whoever_withdraws_while_nothing_can_be_saved_is_erased_when_it_can": (
        "with the erasing",
    ),
    "tests/lab/test_study_changed.py::test_who_was_enrolled_before_a_change_goes_on": ("another layout",),
    "tests/store/test_migration.py::test_a_recorded_trial_goes_on_with_its_next_tick": ("0001-bullet",),
    "tests/sim/test_robot_contract.py::TestBullet::test_every_object_from_every_place_into_every_bin": (
        "paper_towels-rows",
        "sponge_pack-arc",
        "bleach_bottle-crescent",
    ),
    "tests/sim/test_robot_contract.py::TestMujoco::test_every_object_from_every_place_into_every_bin": (
        "paper_towels-rows",
        "sponge_pack-arc",
        "bleach_bottle-crescent",
    ),
    "tests/sim/test_way_out.py::test_every_way_out_moves_the_arm_within_two_ticks_and_alone_it_does_not_press_on": (
        "bullet-0",
        "mujoco-0",
    ),
    "tests/sim/view/test_viewpoints.py::"
    "test_in_a_dropoff_the_arm_hides_no_object_and_not_much_more_than_half_of_a_bin": ("crescent",),
    "tests/simulated/test_clumsy.py::test_a_clumsy_person_finds_nothing_in_physics": ("balanced",),
    "tests/trial/test_way_on.py::test_of_two_hundred_arms_left_alone_none_comes_to_stand_where_it_cannot_go_on": (
        "balanced-crescent",
    ),
    "tests/sim/test_clearance_fallen.py::"
    "test_what_is_allowed_touches_nothing_that_has_fallen_and_what_stays_away_is_allowed": ("0",),
    "tests/contracts/test_one_line.py::test_what_cannot_be_checked_is_told": ("arguments0",),
    "tests/contracts/test_parts_contract.py::test_an_arbiter_that_breaks_it_is_told_what_to_mend": (
        "hangs",
        "keeps hidden state",
        "reads the clock",
        "sleeps",
        "writes into the belief",
    ),
    "tests/browser/test_pads.py::"
    "test_after_anything_that_may_hide_a_release_a_control_counts_once_it_was_seen_at_rest": (
        "stick]",
        "trigger_from_-1",
        "cross_on_one_axis",
        "button_idling_half_way",
    ),
    "tests/browser/test_small_screens.py::test_the_second_device_shows_its_whole_value_and_its_button": (
        "582.4-(320, 640)",
        "88888888.88",
    ),
    "tests/browser/test_ways_on.py::test_a_module_that_does_not_come_through_leaves_no_empty_page": (
        "participant/scene.js",
        "hands/gamepad.js",
    ),
    "tests/browser/test_nback_browser.py::test_two_letters_are_answered": ("second_device",),
}


ON_A_FILE = ("tests/store/test_backup.py", "tests/store/test_certificates.py", "tests/store/test_verification.py")
"""Of tests of what a store does, which run on both kinds of database, those that `make test` runs on a file alone."""


def is_long(node_id: str) -> bool:
    """Whether a test, by its pytest id, is left to `make test-long`."""
    test, _, case = node_id.partition("[")
    if test.startswith(ON_A_FILE):
        return "postgres" in case
    kept = KEPT.get(test)
    return kept is not None and not case.startswith(kept)
