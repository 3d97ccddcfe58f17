"""Cubic splines in their two forms: Hermite nodes, and control points of a uniform B-spline."""
