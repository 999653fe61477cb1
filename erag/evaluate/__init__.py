"""Metrics: pure functions of hits and relevance."""
