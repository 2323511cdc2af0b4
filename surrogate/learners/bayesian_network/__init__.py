"""Networks trained by Bayesian regularisation."""
