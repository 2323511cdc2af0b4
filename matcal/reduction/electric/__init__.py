"""What a strip or block conducts while it is strained: circuits, clocks of two machines, cycles."""
