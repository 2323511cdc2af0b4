"""The electrical problem of the sheet: from strain to electrode voltages, and back to images."""
