"""Constitutive laws as pure functions: hyperfoam, Prony series, conductivity, and their stability."""
