"""Judges of P(Q|A) over ground truth, their cross-vote, and how far they agree with labels."""
