"""Experiments: data sets, systems and judges in, answers on disk, tables and plots out; resumable."""
