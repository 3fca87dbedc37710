"""Graphs written out, node by node and edge by edge, for the libraries that want them so."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bimnav.errors import MissingExtraError
from bimnav.grid import Cell

if TYPE_CHECKING:
    import networkx
    import rustworkx

__all__ = ["Edges", "networkx_of", "rustworkx_of"]

Edges = tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]


def rustworkx_of(count: int, edges: Edges) -> rustworkx.PyGraph[int, float]:
    """Return so many nodes, each with its number, and weighted edges; of parallel ones, the cheapest."""
    import rustworkx

    graph: rustworkx.PyGraph[int, float] = rustworkx.PyGraph(
        multigraph=False, node_count_hint=count, edge_count_hint=len(edges[0])
    )
    graph.add_nodes_from(range(count))
    # one tuple at a time: a list of them all takes three times as long to make as the graph
    graph.add_edges_from(zip(*(part.tolist() for part in edges), strict=True))
    return graph


def networkx_of(cells: Iterable[tuple[Cell, dict[str, Any]]], edges: Edges) -> networkx.Graph[Cell]:
    """Return cells with their attributes as nodes, and weighted edges between them by number."""
    try:
        import networkx
    except ImportError as error:
        raise MissingExtraError("to_networkx needs networkx.", "pip install 'bimnav[networkx]'") from error
    nodes = list(cells)
    graph: networkx.Graph[Cell] = networkx.Graph()
    graph.add_nodes_from(nodes)
    graph.add_weighted_edges_from(
        (nodes[i][0], nodes[j][0], w) for i, j, w in zip(*(part.tolist() for part in edges), strict=True)
    )
    return graph
