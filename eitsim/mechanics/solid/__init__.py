"""Grid, kernels and assembly of the foam."""
