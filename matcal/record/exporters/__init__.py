"""Material cards in the input languages of finite-element programs: one module a target, `deck` puts them together.

A new program is one module that holds its `TARGET`, and its name in `programs`.
"""
