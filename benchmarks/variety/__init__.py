"""What ``benchmarks/diversity.py`` is made of.

``solves`` solves each task from many guesses and keeps rows, ``clusters`` gathers the solutions of
a task into modes, ``character`` says what a solution is like, ``summary`` what all comes to, and
``picture`` draws it.
"""
