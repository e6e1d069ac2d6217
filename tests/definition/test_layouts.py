"""A layout of a study's own: from a file beside the study file into its text, and each mistake told with its line."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.trial.world import layout_of, open_study, parse_text
from study.definition.layouts import LayoutFile, shipped_layouts, shipped_objects
from study.definition.study import DEFAULT_STUDY, Study, StudyFileError
from study.definition.toml_reader import line_numbers, parse_toml
from study.definition.toml_writer import as_table, long_text, toml
from tests.support.study_samples import lab_study, lab_text

EXAMPLE = Path(__file__).resolve().parents[2] / "docs" / "examples" / "05_layout"
STUDY, KITCHEN, MUG = (
    (EXAMPLE / name).read_text(encoding="utf-8") for name in ("study.toml", "kitchen.toml", "mug.obj")
)
SHIPPED = DEFAULT_STUDY.read_text(encoding="utf-8")


def write(folder: Path, study: str = STUDY, kitchen: str | None = KITCHEN, mug: str | bytes | None = MUG) -> Path:
    """A study file with a layout and a mesh beside it."""
    (folder / "study.toml").write_text(study, encoding="utf-8")
    if kitchen is not None:
        (folder / "kitchen.toml").write_text(kitchen, encoding="utf-8")
    if mug is not None:
        (folder / "mug.obj").write_bytes(mug.encode() if isinstance(mug, str) else mug)
    return folder / "study.toml"


def problems(file: Path) -> list[str]:
    """What is told, without the folder."""
    with pytest.raises(StudyFileError) as caught:
        open_study(file)
    return [line.replace(f"{file.parent}/", "") for line in caught.value.problems]


def changed(text: str, old: str, new: str) -> str:
    assert text.count(old) == 1, f"{old!r} stands {text.count(old)} times"
    return text.replace(old, new)


def line_of(text: str, part: str) -> int:
    """The line on which a part of the text begins."""
    assert part in text, f"{part!r} is not in the text"
    return text[: text.index(part)].count("\n") + 1


@pytest.fixture
def study(tmp_path: Path) -> Study:
    return open_study(write(tmp_path))


def test_a_layout_beside_the_file_has_its_objects_places_and_bins(study: Study) -> None:
    layout = layout_of(study)
    assert (layout.name, len(layout.places), len(layout.objects)) == ("kitchen", 8, 8)
    assert [item.id for item in layout.bins] == ["cupboard", "recycling"]
    assert [item.letter for item in layout.bins] == ["C", "R"]
    assert layout.bins[0].release_world_m == (0.51, 0.48, 0.90), "above the middle when left out"
    assert layout.bins[0].color_rgb == (0x7B, 0x4F, 0x9D)
    mug, jam, tea = layout.objects[0], layout.objects[4], layout.objects[6]
    assert (mug.look.mesh_obj, mug.grasp_height_m) == (MUG, 0.07)
    assert (jam.friction, jam.grasp_height_m) == (0.5, 0.10), "2 cm below a top that is low"
    assert (tea.friction, tea.grasp_height_m) == (0.65, 0.11)
    assert layout.table == layout_of(lab_study()).table, "arc's when left out"


def test_the_studys_text_holds_all_that_is_needed_to_run_it_again(tmp_path: Path, study: Study) -> None:
    alone = parse_text(study.source_text, "stored study")
    assert (alone, alone.hash) == (study, study.hash)
    assert study.source_text.startswith(STUDY.rstrip("\n"))
    copied = tmp_path / "elsewhere"
    copied.mkdir()
    assert open_study(write(copied, study.source_text, kitchen="broken", mug="broken")).hash == study.hash


@pytest.mark.parametrize("file", ["kitchen.toml", "mug.obj"])
def test_what_stands_beside_the_file_is_in_the_studys_hash(tmp_path: Path, study: Study, file: str) -> None:
    beside = tmp_path / file
    beside.write_text(beside.read_text(encoding="utf-8").replace("45", "44", 1), encoding="utf-8")
    assert open_study(tmp_path / "study.toml").hash != study.hash


def test_a_layout_that_the_study_does_not_name_is_no_part_of_it(tmp_path: Path) -> None:
    assert open_study(write(tmp_path, SHIPPED)).source_text == SHIPPED


def test_a_layout_may_stand_in_the_study_file(tmp_path: Path, study: Study) -> None:
    tables = KITCHEN.replace("[[bins]]", "[[layouts.bins]]").replace("[[objects]]", "[[layouts.objects]]")
    inline = open_study(write(tmp_path, f'{STUDY}\n[[layouts]]\nid = "kitchen"\n{tables}', kitchen=None))
    assert layout_of(inline) == layout_of(study)


def test_shipped_objects_may_stand_on_an_own_layout(tmp_path: Path) -> None:
    text = changed(STUDY, '"tea", "detergent"]', '"tea", "wipes_tub"]')
    # The tub is wider than the kitchen's own things, so that places have to be farther apart.
    found = problems(write(tmp_path, text))
    assert found[0] == (
        f"kitchen.toml:{line_of(KITCHEN, '[0.875, 0.326]')}: places_m[2] = [0.875, 0.326]: "
        "place 1 and place 2 are 0.164 m apart; objects 0.072 m wide need 0.172 m"
    )
    assert len(found) == 7


def test_a_layout_of_a_few_lines_is_enough(tmp_path: Path) -> None:
    text = changed(lab_text(), 'layout = "arc"', 'layout = "kitchen"')
    arc = shipped_layouts()["arc"]
    small = f"places_m = {[list(place) for place in arc.places_m]}\n"
    layout = layout_of(open_study(write(tmp_path, text, small)))
    shipped = layout_of(lab_study())
    assert (layout.table, layout.bins, layout.aisle_x_m) == (shipped.table, shipped.bins, shipped.aisle_x_m)
    assert (layout.start_world_m, layout.practice_place) == (shipped.start_world_m, shipped.practice_place)
    assert layout.objects == shipped.objects
    assert LayoutFile(places_m=arc.places_m).model_dump() == arc.model_dump(exclude={"id"}) | {
        "bins": tuple(item.model_dump() | {"release_m": None} for item in arc.bins)
    }


CASES = [
    ("size_m = [0.06, 0.06, 0.13]", "size_m = [0.12, 0.06, 0.13]", "objects[7].size_m = [0.12, 0.06, 0.13]",
     "0.12 m wide; the gripper opens 0.1 m and needs 0.013 m on each side: at most 0.074 m both ways"),
    ("size_m = [0.06, 0.06, 0.13]", "size_m = [0.06, nan, 0.13]", "objects[7].size_m = [0.06, nan, 0.13]",
     "must be a list of 3 numbers, [x, y, z] in metres, each from 0.02 to 0.3"),
    ("size_m = [0.06, 0.06, 0.13]", "size_m = [0.06, 0.06]", "objects[7].size_m = [0.06, 0.06]", "must be a list of 3"),
    ("size_m = [0.05, 0.05, 0.19]", "size_m = [0.05, 0.06, 0.19]", "objects[6].size_m", "as long as it is wide"),
    ("mass_kg = 0.12", "mass_kg = 1.5", "objects[7].mass_kg = 1.5",
     "two fingers press with 18 N and hold, at friction 0.65, at most 1.19 kg with a margin of 2"),
    ("mass_kg = 0.12", "mass_kg = nan", "objects[7].mass_kg = nan", "must be a number at least 0.05 and at most 3.0"),
    ("mass_kg = 0.12", 'mass_kg = "light"', 'objects[7].mass_kg = "light"', "must be a number at least 0.05"),
    ("grasp_height_m = 0.07", "grasp_height_m = 0.095", "objects[1].grasp_height_m = 0.095",
     "0.095 m; must be from 0.06 m, where the gripper clears the table, to 0.0868 m, where the fingers are on the"),
    ("mass_kg = 0.40\nfriction = 0.5", "mass_kg = 0.40\nfriction = 0.15", "objects[5].mass_kg = 0.4",
     "at friction 0.15, at most 0.28 kg"),
    ('color = "#2f8f83"', 'color = "teal"', 'objects[7].color = "teal"', 'must be a colour such as "#0072b2"'),
    ('id = "tea"', 'id = "jam"', 'objects[7].id = "jam"', "repeats entry 5; ids must be different"),
    ('id = "tea"', 'id = "sponge_pack"', 'objects[7].id = "sponge_pack"', "is an object that ships; choose another id"),
    ('id = "tea"', 'id = ["tea"]', "objects[7].id = ['tea']", "must be a text, not a list"),
    ('id = "tea"', 'id = "Tea"', 'objects[7].id = "Tea"', "must be lower-case letters, digits and '_'"),
    ('mesh = "mug.obj"', 'mesh = "cup.obj"', 'objects[1].mesh = "cup.obj"', "no such file beside this file"),
    ('mesh = "mug.obj"', 'mesh = "../mug.obj"', 'objects[1].mesh = "../mug.obj"', "must be the name of an OBJ file"),
    ('drawing = "spray_bottle"', 'drawing = "spray_botle"', 'objects[8].drawing = "spray_botle"',
     "did you mean 'spray_bottle'?"),
    ('shape = "cylinder"            #', 'shape = "sphere"  #', 'objects[1].shape = "sphere"', "allowed: cylinder, box"),
    ("[0.765, 0.448]", "[0.72, 0.448]", "places_m[1] = [0.72, 0.448]", "closer than 0.05 m to the table's edge"),
    ("[0.875, 0.326]", "[0.9, 0.42]", "places_m[2] = [0.9, 0.42]",
     "place 2 is out of the arm's reach at z 0.80 m: the arm cannot stretch further"),
    ("[0.875, 0.326]", "[0.875, inf]", "places_m[2] = [0.875, inf]", "must be a list of 2 numbers, [x, y] in metres"),
    ("[0.765, 0.204]", "[0.765, 0.30]", "places_m[3] = [0.765, 0.3]", "place 2 and place 3 are 0.113 m apart"),
    ("[0.765, 0.204]", "[0.75, 0.25]", "places_m[3] = [0.75, 0.25]", "place 2 and place 3 are 0.146 m apart"),
    ("center_m = [0.52, -0.47]", "center_m = [0.52, 0.42]", "bins[2].center_m = [0.52, 0.42]",
     "recycling stands inside cupboard"),
    ("center_m = [0.52, -0.47]", "center_m = [0.62, -0.47]", "bins[2].center_m = [0.62, -0.47]", "inside the table"),
    ("center_m = [0.52, -0.47]", "center_m = [0.5, -1.0]", "bins[2].center_m = [0.5, -1.0]",
     "(0.5, -1, 0.9) m, over recycling, is out of the arm's reach: edge of the workspace"),
    ("height_m = 0.38", "height_m = 0.38\nrelease_m = [0.52, -0.2, 0.9]", "bins[2].release_m = [0.52, -0.2, 0.9]",
     "recycling is not below its release point (0.52, -0.2, 0.9) m"),
    ("height_m = 0.38", "height_m = 0.72", "bins[2].height_m = 0.72", "carried over recycling to its release point"),
    ("height_m = 0.38", 'height_m = 0.38\nletter = "rr"', 'bins[2].letter = "rr"', "must be one of A to Z or 0 to 9"),
    ('id = "recycling"', 'id = "cupboard"', 'bins[2].id = "cupboard"', "repeats entry 1; ids must be different"),
    ('id = "recycling"', 'id = "jam"', 'bins[2].id = "jam"', "is the id of an object; choose another id"),
    ('id = "recycling"', 'id = "sponge_pack"', 'bins[2].id = "sponge_pack"', "is the id of an object"),
    ('label = "recycling"', f'label = "{"r" * 81}"', "bins[2].label", "must have at most 80 characters"),
    ('label = "cereal box"', f'label = "{"c" * 81}"', "objects[2].label", "must have at most 80 characters"),
    ("\nplaces_m", "\naisle_x_m = 0.72\nplaces_m", "aisle_x_m = 0.72", "too near the objects, the first at x 0.765 m"),
    ("\nplaces_m", "\naisle_x_m = 0.41\nplaces_m", "aisle_x_m = 0.41", "the aisle at x 0.41 m, z 0.86, "),
    ("\nplaces_m", "\nstart_m = [0.3, 0.0, 0.9]\nplaces_m", "start_m = [0.3, 0.0, 0.9]", "out of the arm's reach"),
    ("\nplaces_m", "\npractice_place_m = [0.6, 0.0]\nplaces_m", "practice_place_m = [0.6, 0.0]", "the table's edge"),
    ("\nplaces_m", "\nplace_m = []\nplaces_m", "place_m = []", "unknown field; did you mean 'places_m'?"),
    ("[[bins]]\nid = \"cup", "[table]\ncenter_m = [0.9, 0.0, 0.75]\n[[bins]]\nid = \"cup", "table",
     "its top is 0.77 m high; the palm clears one of at most 0.75025 m"),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "label", "says"), CASES)
def test_each_mistake_is_told_with_its_line(tmp_path: Path, old: str, new: str, label: str, says: str) -> None:
    kitchen = changed(KITCHEN, old, new)
    key = label.rpartition(".")[2].split(" =")[0].split("[")[0]
    above = new.count("\n", 0, new.index(key)) if key in new else 0
    place = f"kitchen.toml:{line_of(KITCHEN, old) + above}: {label}"
    found = problems(write(tmp_path, kitchen=kitchen))
    mine = [line for line in found if line.startswith(place) and says in line]
    assert mine, found
    assert all(line.startswith(("kitchen.toml:", "study.toml:")) for line in found)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        (
            '"jam", "pepper"',
            '"jam", "peper"',
            "objects[6] = \"peper\": not known; did you mean 'pepper'?",
        ),
        ('"jam", "pepper"', '"jam", "mug"', 'objects[6] = "mug": repeats entry 1; objects must be different'),
        ('bins = ["cupboard", ', 'bins = ["left_bin", ', 'bins[1] = "left_bin": not known; bins: cupboard, recycling'),
        (
            'layout = "kitchen" ',
            'layout = "kitchn" ',
            'layout = "kitchn": not known; layouts: arc, crescent, rows, or your own',
        ),
        ('"tea", "detergent"]', '"tea", "detergent", "soap"]', 'objects[9] = "soap": not known'),
        ("pickups_per_trial = 3", "pickups_per_trial = 9", "must be at most 8, the number of objects"),
    ],
)
def test_what_the_study_takes_of_a_layout_has_to_be_there(tmp_path: Path, old: str, new: str, says: str) -> None:
    text = changed(STUDY, old, new)
    (told,) = [line for line in problems(write(tmp_path, text)) if says in line]
    assert told.startswith(f"study.toml:{line_of(text, new)}: ")


def test_more_objects_than_places_are_told(tmp_path: Path) -> None:
    kitchen = changed(KITCHEN, "  [0.765, -0.448],\n", "")
    (told,) = problems(write(tmp_path, kitchen=kitchen))
    assert told.startswith(f"study.toml:{line_of(STUDY, 'objects =')}: objects = ")
    assert told.endswith("has 8 entries, layout 'kitchen' has room for 7")


def test_all_problems_of_both_files_are_told_at_once(tmp_path: Path) -> None:
    text = changed(STUDY, "pickups_per_trial = 3", "pickups_per_trial = 0")
    kitchen = changed(changed(KITCHEN, "mass_kg = 0.12", "mass_kg = 2.0"), "[0.765, 0.204]", "[0.765, 0.21]")
    found = problems(write(tmp_path, text, kitchen, mug="v 0 0 0\nf 1 2 3\n"))
    assert [line.split(" = ")[0] for line in found] == [
        f"study.toml:{line_of(text, 'pickups_per_trial')}: pickups_per_trial",
        f"kitchen.toml:{line_of(kitchen, '[0.765, 0.21]')}: places_m[3]",
        f"kitchen.toml:{line_of(kitchen, 'mesh =')}: objects[1].mesh",
        f"kitchen.toml:{line_of(kitchen, 'mass_kg = 2.0')}: objects[7].mass_kg",
    ]
    assert found[2].endswith('objects[1].mesh = "mug.obj": line 2: corner 2: there are 1 vertices so far')


@pytest.mark.parametrize(
    ("mug", "says"),
    [
        (b"v 0 0 0\n" * 200_000, "mug.obj: is larger than 1 MB, the most that is read"),
        (b"v \xff\n", "mug.obj: not UTF-8 text (byte 2); save the file as UTF-8"),
        (b"# nothing\n", 'objects[1].mesh = "mug.obj": no faces: a mesh has lines that begin with v'),
    ],
)
def test_a_mesh_that_cannot_be_used_is_one_line(tmp_path: Path, mug: bytes, says: str) -> None:
    (told,) = problems(write(tmp_path, mug=mug))
    assert says in told


def test_a_layout_that_is_no_toml_is_one_line(tmp_path: Path) -> None:
    assert problems(write(tmp_path, kitchen="places_m = [[1,\n"))[0].startswith("kitchen.toml:2: not valid TOML")


def test_a_layout_is_not_given_the_name_of_one_that_ships(tmp_path: Path) -> None:
    text = f'{SHIPPED}\n[[layouts]]\nid = "rows"\nplaces_m = [[0.85, 0.0]]\n'
    (told,) = problems(write(tmp_path, text))
    assert told.startswith(f"study.toml:{text.count(chr(10)) - 1}: layouts[1].id")
    assert "is a layout that ships; choose another id" in told


def test_meshes_that_nobody_draws_are_told(tmp_path: Path) -> None:
    found = problems(write(tmp_path, f'{STUDY}\n[[meshes]]\nfile = "jug.obj"\ntext = "-"\n'))
    assert [line.rpartition(": ")[2] for line in found] == ["is the mesh of no object; leave it out"]


def test_the_shipped_objects_and_layouts_are_files_of_the_same_kind() -> None:
    assert list(shipped_layouts()) == ["arc", "crescent", "rows"]
    assert list(shipped_objects()) == list(open_study(None).objects)
    assert shipped_layouts()["rows"].bins[0].release_xyz_m == shipped_layouts()["arc"].bins[0].release_xyz_m


def test_what_is_written_into_the_study_is_what_stood_there() -> None:
    source = b'a = 1\nb = [inf, -inf, true]\nc.d = "x\\"y\\u007f"\n"e f" = 1979-05-27\n[[g]]\nh = []\n'
    data, _ = parse_toml(source, "x")
    assert parse_toml(as_table("layouts", "kitchen", data).encode(), "x")[0] == {"layouts": [{"id": "kitchen", **data}]}
    assert toml([float("nan")]) == "[nan]"
    for text in ("plain\ntext\n", "''' \\ \"\n", "ends with '", "\x7f\x01\n", ""):
        assert parse_toml(f"text = {long_text(text)}\n".encode(), "x")[0]["text"] == text
    assert toml({"a": [1, {"b": 2.5}], "c d": {}}) == '{ a = [1, { b = 2.5 }], "c d" = {} }'


def test_an_entry_of_a_list_over_several_lines_has_its_own_line() -> None:
    text = 'a = [ "x, [", # c, d\n  "y", 3,\n  [1,\n 2],\n]\n[t]\nb = [[1, 2], [3,\n4]]\nc = { d = [\n1] }\n'
    lines = line_numbers(text)
    assert [lines["a", number] for number in range(4)] == [1, 2, 2, 3]
    assert (lines["t", "b", 0], lines["t", "b", 1], lines["t", "c"]) == (7, 7, 9)
    assert ("a", 4) not in lines and ("t", "c", 0) not in lines
