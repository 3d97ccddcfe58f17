"""Long-scope locomotion tasks x̄ = (χ̄, γ̄, η̄), and the distribution they are drawn from."""
