"""Error against run time and stability, from the stored tables of benchmarks."""
