"""Figures of data sets, learning, motions and replanners: the paper's Figs. 2–5 and their kin.

Every function returns a ``matplotlib.figure.Figure`` that belongs to no window and no global
state; the caller saves it with :func:`lmtr.figures.style.save`. Colours are one per foot and one
per series, the same in all figures.
"""
