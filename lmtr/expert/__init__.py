"""The expert: trajectory optimisation from a noisy initial guess (Sec. 3.1, 4.1–4.2)."""
