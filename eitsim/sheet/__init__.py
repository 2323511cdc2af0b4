"""The coated surface as a sheet: from strain to conductance."""
