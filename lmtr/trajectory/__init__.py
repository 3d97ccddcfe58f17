"""Trajectories in native nodes, and their evaluation at any time."""
