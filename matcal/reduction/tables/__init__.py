"""Tables that are reduced already, and what they tell of themselves."""
