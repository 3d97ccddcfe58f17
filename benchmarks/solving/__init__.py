"""What ``benchmarks/expert.py`` is made of, and what the others take from it.

``worker`` is the process that solves, ``lanes`` starts such processes and deals tasks out to them,
``rows`` turns a solve into a row, ``figures`` rows into a summary with its targets (by
``statistics``), ``record`` keeps the last summary in ``benchmarks/results/``, ``pairs`` compares
two experts task by task, and ``tables`` shows it all. Other benchmarks have experts made ``ready``
to run at full speed, and like this one keep the ``circumstances`` of their solves.
"""
