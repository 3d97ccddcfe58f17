"""The robot as data: mass, inertia, nominal stance, range of motion, friction."""
