"""What ``benchmarks/obstacles.py`` is made of.

``families`` names the kinds of tasks and experts that are compared, ``solves`` solves their tasks
and keeps rows, ``summary`` says what the rows come to, ``tables`` prints that, and ``picture``
draws it.
"""
