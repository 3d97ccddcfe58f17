"""The independent check of solutions, and the filter that data sets pass through (Sec. 4.2).

Nothing here knows how the expert states its constraints: splines are sampled densely, rotations
are SciPy's, velocities and accelerations are finite differences of the sampled motion, and the
balance equations are written down once more.
"""
