"""Batches, chunks and trees of shared prefixes."""

from hypothesis import given
from hypothesis import strategies as st

from erag.lm.torchlm.plan import CHUNK_TOKENS, MIN_SHARED, Branch, Limits, batches, chunks, common, tree

rows = st.lists(st.lists(st.integers(0, 1), min_size=1, max_size=40).map(tuple), min_size=1, max_size=12)


@given(st.lists(st.integers(1, 500), max_size=50), st.integers(1, 8), st.integers(1, 2000))
def test_batches_cover_all_and_keep_their_limits(widths: list[int], most: int, cells: int) -> None:
    parts = batches(widths, Limits(most, cells))
    assert [i for part in parts for i in part] == list(range(len(widths)))
    for part in parts:
        assert len(part) == 1 or (len(part) <= most and len(part) * max(widths[i] for i in part) <= cells)


@given(st.lists(st.integers(1, 2000), min_size=1, max_size=30))
def test_chunks_cover_all_rows(lengths: list[int]) -> None:
    parts = list(chunks(lengths))
    assert [i for part, _ in parts for i in range(part.start, part.stop)] == list(range(len(lengths)))
    for part, columns in parts:
        assert columns == max(lengths[part])
        assert part.stop - part.start == 1 or (part.stop - part.start) * columns <= CHUNK_TOKENS


@given(rows)
def test_common_is_the_longest_shared_beginning(rows: list[tuple[int, ...]]) -> None:
    end = common(rows)
    assert len({row[:end] for row in rows}) == 1
    assert min(map(len, rows)) == end or len({row[end] for row in rows}) > 1


@given(rows)
def test_a_tree_spells_every_sequence(rows: list[tuple[int, ...]]) -> None:
    ordered = sorted(rows)
    spelt: dict[int, tuple[int, ...]] = {}

    def walk(branch: Branch, before: tuple[int, ...]) -> None:
        assert branch.start == len(before)
        assert branch.tokens or not before
        for member in branch.members:
            spelt[member] = before + branch.tokens
        for child in branch.children:
            assert set(child.members) <= set(branch.members)
            assert len(child.members) == 1 or len(child.tokens) >= MIN_SHARED
            walk(child, before + branch.tokens)

    walk(tree(ordered, range(len(ordered))), ())
    assert [spelt[i] for i in range(len(ordered))] == ordered


def test_equal_prompts_are_one_branch_whatever_follows() -> None:
    system, one, two = tuple(range(20)), tuple(range(100, 120)), tuple(range(200, 220))
    paths = sorted([system + one, system + one + (7, 8), system + two, system + two + (7,), system + one + (9,)])
    root = tree(paths, range(5))
    assert root.tokens == system
    assert [child.tokens for child in root.children] == [one, two]
    assert sorted(len(leaf.tokens) for child in root.children for leaf in child.children) == [1, 1, 2]
