"""Which modulus a table is of, by the name of its column."""


def symbol_of(name: str) -> str:
    """table_of_E, table_of_G, or table_of_modulus where the name does not say which."""
    words = name.lower().strip().lstrip("|")
    if words.startswith(("g", "shear", "schub", "j")):
        return "table_of_G"
    return "table_of_E" if words.startswith(("e", "young", "tensile", "compress", "d")) else "table_of_modulus"
