"""Figures and PDF pages; the only package that draws."""
