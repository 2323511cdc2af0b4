"""Material input of finite-element programs read back into a card: one module a program, `read_deck` chooses among
them."""
