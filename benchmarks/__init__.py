"""Benchmarks, run by hand; ``docs/benchmarks.md`` says which question each of them answers.

``expert.py``, ``linear_solver.py``, ``planner.py``, ``thresholds.py``, ``obstacles.py``,
``diversity.py`` and ``balance.py``; what several of them need lies in ``kept`` and ``solving``.
"""
