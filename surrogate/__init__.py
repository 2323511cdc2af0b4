"""Learning touches from electrode voltages."""
