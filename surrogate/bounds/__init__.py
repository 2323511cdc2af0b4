"""How well any method can read a touch: Fisher information, Cramer-Rao and van Trees bounds."""
