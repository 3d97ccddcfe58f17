"""Benchmarks, run by hand: ``expert.py``, ``obstacles.py``, ``planner.py`` and ``thresholds.py``."""
