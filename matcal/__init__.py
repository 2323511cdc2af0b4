"""Material calibration: load-frame and potentiostat files in, a material card with its uncertainty out."""
