"""Simulated worlds with ground truth: scenes, objects, a renderer, labels, queries (extra `sim`)."""
