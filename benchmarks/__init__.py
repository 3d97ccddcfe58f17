"""Benchmarks, run by hand: ``expert.py`` and ``planner.py``."""
