"""Observations become a topological map: edges, components, routes and graph distances."""
