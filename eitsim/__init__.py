"""Touch simulation: large-strain contact of a foam disc, its conductive skin and the electrode voltages."""
