"""Offline Embodied-RAG: a robot's observations become a memory that can be asked."""
