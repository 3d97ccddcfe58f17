"""Benchmarks, run by hand: ``expert.py``, ``planner.py``, ``thresholds.py`` and ``obstacles.py``.

What several of them need lies in ``kept``.
"""
