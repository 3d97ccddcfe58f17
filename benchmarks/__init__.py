"""Benchmarks, run by hand: ``expert.py``, ``planner.py`` and ``thresholds.py``."""
