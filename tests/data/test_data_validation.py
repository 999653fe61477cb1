"""The rules for observations: what is kept, what is left out, and that both are told."""

import math
from pathlib import Path

import pytest

from erag.core.errors import InputError
from erag.core.text import MAX_CAPTION
from erag.core.types import Frame, Interval, Observation
from erag.data.reading import Issue
from erag.data.rows import ROW_OUT, IssueLog, RawRow
from erag.data.validation import MAX_ID, MAX_NAME, Rules, observations

NAN, INF = math.nan, math.inf


def checked(
    *rows: RawRow, frame: Frame = Frame.METRIC, root: Path = Path("nowhere"), **sensors: tuple[float, float]
) -> tuple[list[Observation], list[Issue]]:
    log = IssueLog("rows")
    made = observations(rows, Rules(frame, root, "test", sensors), log)
    return list(made), log.issues


def row(i: int = 1, **fields: object) -> RawRow:
    return RawRow(**({"line": i, "id": f"n{i}", "x": 1.0, "y": 2.0} | fields))  # type: ignore[arg-type]


def test_a_sound_row_is_kept_as_it_is() -> None:
    made, issues = checked(
        row(yaw=0.5, z=3, name="Desk", caption="A desk.", time="2023-12", sensors={"t": 4}, kind="object")
    )
    (o,) = made
    assert (o.id, o.kind, o.pose.xyz, o.pose.yaw) == ("n1", "object", (1.0, 2.0, 3.0), 0.5)
    assert (o.name, o.caption, o.sensors, o.source) == ("Desk", "A desk.", {"t": 4.0}, "test")
    assert o.time == Interval(1701388800.0, 1704067200.0)
    assert issues == []


@pytest.mark.parametrize(
    ("fields", "told"),
    [
        ({"x": NAN}, "x is nan"),
        ({"y": INF}, "y is inf"),
        ({"z": -INF}, "z is -inf"),
        ({"z": None}, "z is None"),
        ({"x": "1.0"}, "x is '1.0'"),
        ({"x": True}, "x is True"),
        ({"x": 10**400}, "x is an integer of 1329 bits"),
        ({"y": None}, "y is None"),
        ({"x": None, "y": None}, "no position"),
        ({"x": 1e200}, "beyond"),
        ({"id": ""}, "id is empty"),
        ({"id": "  "}, "id is empty"),
        ({"id": 7}, "id is not text: 7"),
        ({"id": None}, "id is not text"),
        ({"id": ["a"]}, "id is not text: a list"),
        ({"id": "x" * (MAX_ID + 1)}, "201 characters"),
        ({"id": "a\x1b[2J"}, "control characters"),
        ({"id": "\ud800"}, "control characters"),
        ({"kind": "tree"}, "kind is 'tree'"),
        ({"kind": ["place"]}, "kind is a list"),
    ],
)
def test_rows_that_cannot_be_used_are_left_out(fields: dict[str, object], told: str) -> None:
    made, issues = checked(row(1, **fields), row(2))
    assert [o.id for o in made] == ["n2"]
    (issue,) = issues
    assert issue.where == "rows:1"
    assert told in issue.what
    assert issue.action == ROW_OUT


@pytest.mark.parametrize(
    ("fields", "told"),
    [
        ({"yaw": NAN}, "yaw is nan"),
        ({"yaw": "north"}, "yaw is 'north'"),
        ({"time": "yesterday"}, "yesterday"),
        ({"time": ""}, "time is empty"),
        ({"time": Interval(1e15, 1e15)}, "years 1 to 9999"),
        ({"caption": ""}, "caption is empty"),
        ({"caption": " \x00 "}, "caption is empty"),
        ({"caption": {"a": 1}}, "caption is not text: an object"),
        ({"name": 5}, "name is not text: 5"),
        ({"image": ""}, "not a path"),
        ({"image": 5}, "not a path"),
        ({"image": "a\x00b"}, "not a path"),
        ({"image": "x" * 2000}, "not a path"),
        ({"image": "/etc/passwd"}, "no path inside the folder"),
        ({"image": "../secret.jpg"}, "no path inside the folder"),
        ({"image": "a/../../b.jpg"}, "no path inside the folder"),
        ({"image": "C:/a.jpg"}, "no path inside the folder"),
        ({"image": "."}, "no path inside the folder"),
        ({"image": "frames/none.jpg"}, "not there"),
        ({"image": "a" * 300}, "not there"),
        ({"sensors": [1]}, "the sensors are a list"),
        ({"sensors": {"ndvi": NAN}}, "reads nan"),
        ({"sensors": {"ndvi": "high"}}, "reads 'high'"),
        ({"sensors": {"ndvi": 2}}, "outside its range -1 to 1"),
        ({"sensors": {"": 0.5}}, "id is empty"),
    ],
)
def test_bad_fields_are_dropped_and_the_row_kept(fields: dict[str, object], told: str, tmp_path: Path) -> None:
    made, issues = checked(row(**fields), root=tmp_path, ndvi=(-1, 1))
    (o,) = made
    assert (o.pose.yaw, o.time, o.image, o.name, o.caption, o.sensors) == (None, None, None, None, None, {})
    assert told in issues[-1].what
    assert all(ROW_OUT not in i.action for i in issues)


def test_an_issue_never_repeats_what_a_hostile_value_holds() -> None:
    deep: list[object] = []
    for _ in range(100_000):
        deep = [deep]
    rows = [row(1, caption=deep, name="\x1b[31m" * 1000), row(2, id="\n" + "y" * 10_000_000), row(3, x=deep)]
    _, issues = checked(*rows)
    assert all(len(i.what) <= 300 and i.what.isprintable() for i in issues)


def test_texts_are_tidied_and_cut_at_a_word() -> None:
    words = "word " * MAX_CAPTION
    odd = row(2, caption="a\x07 b\n\tc", name="e\u200d\u0301")
    made, issues = checked(row(1, caption=words, name="n" * 1000), odd, row(3, caption="k " * 9))
    assert made[0].caption == words[: MAX_CAPTION - 1]
    assert made[0].name == "n" * MAX_NAME
    assert made[1].caption == "a b c"
    assert made[1].name == "\u00e9"
    assert [(i.where, i.action) for i in issues] == [
        ("rows:1", f"name cut to {MAX_NAME} characters"),
        ("rows:1", f"caption cut to {MAX_CAPTION} characters"),
        ("rows:2", "control characters dropped"),
    ]


def test_a_ten_megabyte_caption_is_cut() -> None:
    made, issues = checked(row(caption="\u00e9\u0301 " * 3_000_000))
    assert len(made[0].caption or "") <= MAX_CAPTION
    assert "9,000,000 characters" in issues[0].what


def test_duplicates_keep_the_first_and_say_whether_they_differ() -> None:
    again = [row(2, id="n1"), row(3, id="n1", x=9.0, caption="")]
    made, issues = checked(row(1), *again, row(4, id="n4", x=NAN), row(5, id="n4"))
    assert [(o.id, o.pose.x) for o in made] == [("n1", 1.0), ("n4", 1.0)]
    told = [(i.where, i.what) for i in issues]
    assert told[0] == ("rows:2", "the id 'n1' of line 1 again, the same row")
    assert told[1] == ("rows:3", "the id 'n1' of line 1 again, with other content")
    assert told[2] == ("rows:4", "x is nan, not a finite number")
    assert len(told) == 3


def test_every_row_is_an_observation_or_an_issue_that_says_so() -> None:
    rows = [row(i, x=NAN if i % 3 == 0 else 1.0, id=f"n{i // 2}", yaw=NAN, caption="") for i in range(60)]
    made, issues = checked(*rows)
    assert len(made) + sum(i.action.startswith(ROW_OUT) for i in issues) == 60


@pytest.mark.parametrize(("x", "y"), [(181.0, 40.0), (0.0, 91.0), (-200.0, 200.0)])
def test_degrees_out_of_range_are_left_out(x: float, y: float) -> None:
    made, issues = checked(row(1, x=x, y=y), row(2), frame=Frame.WGS84)
    assert [o.id for o in made] == ["n2"]
    assert issues[0].action == ROW_OUT


def test_a_latitude_that_only_fits_as_longitude_looks_swapped() -> None:
    _, issues = checked(row(1, x=37.5, y=127.0), row(2, x=127.0, y=37.5), frame=Frame.WGS84)
    assert "look swapped" in issues[0].what
    assert issues[0].action == ROW_OUT


def test_a_file_that_is_swapped_throughout_is_named_so() -> None:
    with pytest.raises(InputError, match="all 3 positions look swapped: x must be the longitude"):
        checked(*(row(i, x=37.5, y=127.0 + i) for i in range(3)), frame=Frame.WGS84)


def test_a_single_swapped_row_is_found_by_its_neighbours() -> None:
    rows = [row(i, x=-79.94 + i / 1e4, y=40.44) for i in range(8)]
    made, issues = checked(*rows, row(9, x=40.44, y=-79.94), frame=Frame.WGS84)
    assert len(made) == 8
    assert [(i.where, i.action) for i in issues] == [("rows:9", ROW_OUT)]
    made, issues = checked(*rows, row(9, x=2.35, y=48.86), frame=Frame.WGS84)  # far away, but not swapped
    assert len(made) == 9
    assert issues == []


def test_a_map_swapped_within_the_ranges_is_kept_and_told() -> None:
    made, issues = checked(*(row(i, x=40.44, y=-79.94 + i / 1e4) for i in range(5)), frame=Frame.WGS84)
    assert len(made) == 5
    (issue,) = issues
    assert issue.where == "rows"
    assert "look swapped" in issue.what
    assert "kept" in issue.action


def test_a_map_across_the_antimeridian_is_not_taken_for_swapped() -> None:
    made, issues = checked(*(row(i, x=(-1) ** i * 179.9, y=-17.0) for i in range(6)), frame=Frame.WGS84)
    assert len(made) == 6
    assert issues == []


def test_nothing_usable_is_an_error_that_names_the_first_row() -> None:
    with pytest.raises(InputError, match=r"none of its 2 rows can be used; the first: rows:1: x is nan"):
        checked(row(1, x=NAN), row(2, x=INF))
    with pytest.raises(InputError, match="no observation"):
        checked()


def test_images_are_checked_inside_the_folder(tmp_path: Path) -> None:
    root = tmp_path / "source"
    root.mkdir()
    (root / "a.jpg").write_bytes(b"x")
    (root / "dir.jpg").mkdir()
    (tmp_path / "secret.jpg").write_bytes(b"x")
    (root / "link.jpg").symlink_to(tmp_path / "secret.jpg")
    (root / "loop.jpg").symlink_to(root / "loop.jpg")
    names = ["a.jpg", "./a.jpg", "dir.jpg", "link.jpg", "loop.jpg"]
    made, issues = checked(*(row(i, image=name) for i, name in enumerate(names)), root=root)
    assert [o.image for o in made] == ["a.jpg", "a.jpg", None, None, None]
    assert sorted(i.where for i in issues) == ["rows:2", "rows:3", "rows:4"]


def test_images_all_missing_are_one_issue_and_some_are_one_each(tmp_path: Path) -> None:
    rows = [row(i, image=f"{i}.jpg") for i in range(20)]
    _, issues = checked(*rows, root=tmp_path)
    assert [(i.where, i.what[:24]) for i in issues] == [("rows", "none of its 20 images is")]
    (tmp_path / "3.jpg").write_bytes(b"x")
    made, issues = checked(*rows, root=tmp_path)
    assert len(issues) == 19
    assert [o.id for o in made if o.image] == ["n3"]


def test_a_map_of_far_places_is_not_taken_for_swapped() -> None:
    """Mirrored places are only suspicious where most rows lie in one place."""
    rows = [row(i, x=10.0 * i, y=40.0) for i in range(5)]
    made, issues = checked(*rows, row(6, x=40.0, y=10.0), frame=Frame.WGS84)
    assert len(made) == 6
    assert issues == []
