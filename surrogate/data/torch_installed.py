"""PyTorch, which is installed where networks are trained or exported, and nowhere else needed."""


def check_torch(what: str) -> None:
    """ValueError with what to install where it is missing; what: what needs it."""
    try:
        import torch  # noqa: F401
    except ImportError:
        raise ValueError(f"{what} need PyTorch, which is not installed; run pip install '.[networks]' in the project's "
                         "folder.") from None
