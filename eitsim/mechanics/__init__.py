"""The mechanical problem of the foam: large-strain contact of a rigid punch."""
