"""What ``benchmarks/thresholds.py`` is made of.

``solves`` has tasks solved, or reads them from a file, ``removal`` says what each threshold removes
and suggests others, ``costs`` compares ways to judge a cost, and ``picture`` draws it all.
"""
