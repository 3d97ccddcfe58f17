"""A look over a cluster: what can be reached, whom it lets in, what each of its nodes has.

``entrance`` (asked from here) → ``examine`` (a small job on the head, which asks every node for
what ``machine`` tells, and looks at home and tracker) → ``report`` (what the job prints) →
``judgement`` and ``nodes`` (what is to be said of it) → ``cluster`` (all of it in turn).
``finding`` is also what the look over one machine (:mod:`pipelines.doctor`) ends in.
"""
