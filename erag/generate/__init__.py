"""Hits to an answer: waypoint, route and a text that quotes what was seen."""
