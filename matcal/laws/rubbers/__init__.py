"""Laws of rubbers: an energy of the stretches at constant volume each, and what follows from it once."""
