"""Segmentation: from long solutions to pairs (x, τ) of reduced scope (Sec. 3.1, 4.1)."""
