"""Material cards in the input formats of finite-element codes, one module a code."""
