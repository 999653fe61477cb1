"""Observations to a topological map: edges, components, routes, graph distances."""
