"""Benchmarks, run by hand.

``expert.py``, ``planner.py``, ``thresholds.py``, ``obstacles.py`` and ``diversity.py``; what
several of them need lies in ``kept``.
"""
