"""Rotations, ground-plane poses and ground-plane lines."""
