"""Identification of the laws: hyperfoam, Prony series and conductivity."""
