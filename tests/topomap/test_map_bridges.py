"""The bridges of a map are a minimum spanning tree over its components."""

import networkx as nx
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from erag.core.geometry import pairwise
from erag.core.types import Frame
from erag.topomap.bridges import bridges, components

LABELLED = st.lists(
    st.tuples(st.integers(-5, 5), st.integers(-5, 5), st.integers(0, 2), st.integers(0, 6)), max_size=16
)
Labelled = list[tuple[int, int, int, int]]


def prepared(points: Labelled, frame: Frame) -> tuple[np.ndarray, np.ndarray]:
    """Positions and labels counted from 0; on the globe around a point of the antimeridian near the pole."""
    table = np.array(points, np.float64).reshape(-1, 4)
    _, label = np.unique(table[:, 3], return_inverse=True)
    if frame is Frame.METRIC:
        return table[:, :3], label
    lon = (table[:, 0] * 0.1 + 360) % 360 - 180
    return np.column_stack([lon, 89.9 + table[:, 1] * 0.02, table[:, 2] * 100]), label


def component_graph(frame: Frame, positions: np.ndarray, label: np.ndarray) -> nx.Graph:
    """Components and the shortest distance between each two of them, by brute force."""
    metres = pairwise(frame, positions, positions)
    graph = nx.Graph()
    graph.add_nodes_from(set(label.tolist()))
    for a in graph:
        for b in (b for b in graph if b > a):
            graph.add_edge(a, b, weight=metres[np.ix_(label == a, label == b)].min())
    return graph


@given(LABELLED, st.sampled_from(list(Frame)))
@example([(0, 0, 0, 0), (1, 0, 0, 1), (1, 1, 0, 2), (0, 1, 0, 3)], Frame.METRIC)
@example([(0, 0, 0, i) for i in range(7)], Frame.METRIC)
def test_bridges_are_a_minimum_spanning_tree(points: Labelled, frame: Frame) -> None:
    positions, label = prepared(points, frame)
    index, metres = bridges(frame, positions, label, None)
    whole = component_graph(frame, positions, label)
    joined = nx.Graph(label[index].T.tolist())
    joined.add_nodes_from(whole)
    assert index.shape[1] == max(0, len(whole) - 1)
    assert len(whole) == 0 or nx.is_connected(joined)
    assert metres == pytest.approx([pairwise(frame, positions[[a]], positions[[b]])[0, 0] for a, b in index.T])
    assert metres.sum() == pytest.approx(nx.minimum_spanning_tree(whole).size(weight="weight"))


@given(LABELLED, st.floats(0.5, 9))
def test_bridges_longer_than_the_limit_are_left_out(points: Labelled, limit: float) -> None:
    positions, label = prepared(points, Frame.METRIC)
    _, metres = bridges(Frame.METRIC, positions, label, limit)
    tree = nx.minimum_spanning_tree(component_graph(Frame.METRIC, positions, label))
    short = [m for _, _, m in tree.edges(data="weight") if m <= limit]
    assert sorted(metres) == pytest.approx(sorted(short))


@given(st.integers(1, 12), st.lists(st.tuples(st.integers(0, 11), st.integers(0, 11)), max_size=14))
def test_components_equal_networkx(n: int, pairs: list[tuple[int, int]]) -> None:
    inside = [(a % n, b % n) for a, b in pairs]
    count, label = components(n, np.array(inside, np.int64).reshape(-1, 2).T)
    graph = nx.Graph(inside)
    graph.add_nodes_from(range(n))
    groups = sorted(map(sorted, nx.connected_components(graph)))
    assert count == len(groups)
    assert [np.flatnonzero(label == i).tolist() for i in range(count)] == groups
