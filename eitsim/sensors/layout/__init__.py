"""Which electrodes, currents and readings tell a touch best: Cramer-Rao bounds over the disc."""
