"""The ways in which touches are solved, a file each."""
