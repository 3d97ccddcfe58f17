"""Task vectors x and segment vectors τ (Sec. 3.1, 4.3): their layouts, coding, scaling, mirror."""
