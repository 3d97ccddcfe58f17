"""Linear solver for the expert's Newton steps, made for the one sparsity that they all share.

IPOPT's own solver is general: it finds an order of elimination, and pivots, anew in every process
and guards against what quasi-definite systems do not do. Here the order is found once, the tables
of everything that does not depend on values are compiled beside a small numeric kernel, and IPOPT
loads the result through the calling convention of MA27. ``benchmarks/linear_solver.py`` tells what
it saves.
"""
