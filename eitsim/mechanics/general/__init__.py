"""Any number of punches on a flat layer of any outline, in three dimensions."""
