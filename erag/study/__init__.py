"""Training of students and the figures that say how good they are (extra `train`)."""
