"""Constitutive laws as pure functions: foams, rubbers, Prony series, conductivity, and their stability."""
