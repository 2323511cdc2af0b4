"""Variable projection of the hyperfoam law: exponents are searched, moduli solved for."""
