"""Readers that turn files into observations, and writers of our own formats."""
