"""Retrieval metrics and their uncertainty under one name; see `ranking`, `location`, `text`, `statistics`, `cost`."""

from __future__ import annotations

from erag.evaluate.ranking import average_precision, mrr, ndcg_at, precision_at, recall_at, reciprocal_rank, success_at
from erag.evaluate.statistics import Interval, bootstrap, mean

__all__ = [
    "Interval",
    "average_precision",
    "bootstrap",
    "mean",
    "mrr",
    "ndcg_at",
    "precision_at",
    "recall_at",
    "reciprocal_rank",
    "success_at",
]
