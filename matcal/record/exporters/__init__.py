"""Material cards in the input languages of finite-element programs: one module a target, `deck` puts them together."""
