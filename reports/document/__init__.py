"""Page template, style and numbers of every report."""
