"""A page on which one presses the skin and sees it read: its server, and the page as one file."""
