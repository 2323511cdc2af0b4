"""Files of boards as recordings: one module a layout, named in `open_file.formats`."""
