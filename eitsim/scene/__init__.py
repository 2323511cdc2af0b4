"""The question and the answer as frozen dataclasses."""
