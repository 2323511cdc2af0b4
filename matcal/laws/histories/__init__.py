"""What loading in time and before leaves: creep and relaxation, temperature, softening and set."""
