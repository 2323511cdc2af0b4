"""One scene: plan, solution, error budget."""
