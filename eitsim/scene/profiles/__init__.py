"""Outlines of rigid punches of revolution, one file a family; `registry` names them."""
